"""The constants that decide what is said of a model, each with what it controls; docs/tool.md has trials of two."""

ALPHA = 0.01  # probability of believing in what is not there, all that was asked for together
K = 3.0  # standard errors of their difference within which two candidates are a tie
TOLERANCE = 2e-3  # of the rms response, or of a coefficient: what is practically nothing
GOOD = 0.0075  # of the rms response: what models of real structures leave, however complete
ENOUGH = 0.99  # of the unexplained power: what explains so much is missing, whatever is missing besides
NEARLY = 0.9  # of what an unphysical or wandering effect explains: one that is neither and explains so much comes first
UNSTEADY = 0.3  # change of a coefficient, of itself, that is forgiven where a good model's own faults may move it
BLOCKS = 48  # of time, over which residuals are compared
PROMISING = 0.3  # of what is left, or of what the best explains: what promises so much is fitted
