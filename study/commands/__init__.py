"""The commands of ``study``: one module each, which unpacks arguments, calls the package and prints.

These modules import nothing but argparse at their top, so that ``study --help`` starts at once; what a
command needs is imported when it runs.
"""
