from study.interface.data import Record as Record
from study.interface.data import read as read
from study.interface.data import record as record
from study.interface.equation import Model as Model
from study.interface.equation import Term as Term
from study.interface.equation import library as library
from study.interface.equation import term as term
from study.interface.fitted import Fit as Fit
from study.interface.forces import Force as Force
from study.interface.forces import gaussian as gaussian
from study.interface.forces import multisine as multisine
from study.interface.forces import simulate as simulate
from study.interface.forces import sweep as sweep
from study.interface.forces import waves as waves
from study.interface.found import Candidate as Candidate
from study.interface.found import Diagnosis as Diagnosis
from study.interface.paths import Identification as Identification
from study.interface.paths import identify as identify
from study.interface.planned import PlannedTest as PlannedTest
from study.interface.side_by_side import Across as Across
from study.interface.side_by_side import Ranking as Ranking
from study.interface.side_by_side import compare as compare
from study.support.errors import StudyError as StudyError

__version__: str
