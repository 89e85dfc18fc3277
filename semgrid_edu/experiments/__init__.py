"""The paper's experiments at reduced scale, each one a command (sections 4.3 and 4.4)."""
