from .casadi_functions import CasadiFunctions as CasadiFunctions
from .casadi_functions import to_casadi as to_casadi
from .cuda.mechanism import CudaMechanism as CudaMechanism
from .engine.compiled import CompiledMechanism as CompiledMechanism
from .engine.compiling import compile_mechanism as compile_mechanism
