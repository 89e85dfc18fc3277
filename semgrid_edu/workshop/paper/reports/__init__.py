"""The paper's tables, figures, claims and ablations, written from the runs."""
