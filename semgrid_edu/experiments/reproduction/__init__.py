"""The paper's tables, claims and ablations as runs: units of work that are shared, resumed and spread over machines."""
