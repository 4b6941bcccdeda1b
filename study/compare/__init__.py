"""How good is a model, and where does it fail?

``comparison`` puts it together; the other modules hold one question each, or the words, the pictures and the files.
"""
