"""What knows nothing of vibration: files, configuration, documents, units, least squares, statistics."""
