"""The paper's experiments: the runs, and the reports made from them."""
