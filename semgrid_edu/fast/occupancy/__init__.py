"""CMCDOT in compiled loops and single precision, with the evidence computed on a second core."""
