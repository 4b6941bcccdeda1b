"""Which physical effect is missing from a model?"""
