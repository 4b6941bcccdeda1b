"""How good is a model, and where does it fail?

``comparison`` puts it together; the other modules hold one question each: ``fitted`` the coefficients,
``judged`` the free run on the part that was not fitted, ``noise`` what no model could explain, ``reverse``
the error of the force, ``restoring`` the force that the model lacks, ``frequency``, ``amplitude``,
``surface``, ``stretches`` and ``levels`` where it lacks it, ``says`` the sentences, ``report`` and
``pictures`` the files.
"""
