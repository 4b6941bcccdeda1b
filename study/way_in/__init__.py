"""The way in: records of any kind of test, laid out for a model and compared; for commands, notebook, page, trials."""
