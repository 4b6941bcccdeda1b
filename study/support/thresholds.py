"""The constants that decide what is said of a model; docs/tool.md tells what each controls, and trials that it does."""

ALPHA = 0.01  # probability of believing in what is not there, all that was asked for together
K = 3.0  # standard errors of their difference within which two candidates are a tie
TOLERANCE = 2e-3  # of the rms response: what is practically nothing
GOOD = 0.0075  # of the rms response: what models of real structures leave, however complete
ENOUGH = 0.99  # of the unexplained power: what explains so much is missing, whatever is missing besides
STILL = 0.01  # by how much of itself a coefficient may change with the amplitude and still be called a constant ...
UNSTEADY = 0.3  # ... and where what is left is that of a good model, whose faults move what is added to it
BLOCKS = 48  # of time, over which residuals are compared
