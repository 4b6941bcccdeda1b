"""An equation of motion: its terms, its file, and its motion under a force."""
