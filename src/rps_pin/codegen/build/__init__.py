"""From C to loaded functions: compilers, the cache of what they made, builds in the background.

`build` takes a `Source` (C texts) and the function that proves a library, and gives a `Library`.
What the C says is no matter of this package, and neither is what a proof compares.
"""

from rps_pin.codegen.build.builder import build
from rps_pin.codegen.build.cache import cache_folder, clear
from rps_pin.codegen.build.library import Library
from rps_pin.codegen.build.source import Source

__all__ = ["Library", "Source", "build", "cache_folder", "clear"]
