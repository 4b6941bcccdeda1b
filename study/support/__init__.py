"""What knows nothing of vibration: files, documents, schemas, units, least squares, statistics."""
