"""Which physical effect is missing from a model?"""

# What a verdict is called.
MISSING, SEVERAL, PARTLY_KNOWN = "missing_effect", "missing_effects", "partly_known"
NOTHING, UNKNOWN = "nothing_missing", "unknown_effect"
