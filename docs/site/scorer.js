// How the search sorts what it finds: a page whose title has the term, such as a lecture, before a name of the code.
var Scorer = {
  objNameMatch: 3,
  objPartialMatch: 2,
  objPrio: { 0: 0, 1: 0, 2: 0 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 12,
  term: 5,
  partialTerm: 2,
};
