"""The gallery of measured records: what is known of each, what was found in it, and what is left, from files alone."""
