"""Units of work planned, shared, resumed, and spread over processes, machines and GPUs."""
