"""Readers of published data sets: KITTI raw, tracking and Zhang labels, SYNTHIA, SemanticKITTI."""
