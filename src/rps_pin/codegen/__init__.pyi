from rps_pin.codegen.casadi_functions import CasadiFunctions as CasadiFunctions
from rps_pin.codegen.casadi_functions import to_casadi as to_casadi
from rps_pin.codegen.engine.compiled import CompiledMechanism as CompiledMechanism
from rps_pin.codegen.engine.compiling import compile_mechanism as compile_mechanism
