"""A mechanism as files of C for another machine: header, source, self-test, CMake, page of use.

`c_files.c_files` writes them. The functions come from `rps_pin.codegen.functions`; here are their
words, the order of their numbers, and states with the Pinocchio engine's answers. Not here: builds
for this machine, which `rps_pin.codegen.build` makes.
"""
