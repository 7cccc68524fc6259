"""Compiler launcher (CMAKE_CXX_COMPILER_LAUNCHER): compiles the sources of the core otherwise than the rest.

    core_compiler.py coverage BUILD COMPILER ARGUMENT...   counts branches, unoptimised
    core_compiler.py mutants BUILD COMPILER ARGUMENT...    the copy of mutate.py instead of the source
"""

import os
import shutil
import sys

sys.dont_write_bytecode = True

from core import HERE, ROOT, sources

mode, build, command = sys.argv[1], sys.argv[2], sys.argv[3:]
places = {str(ROOT / source): source for source in sources()}
source = next((argument for argument in command if argument in places), None)
environment = os.environ
if source and mode == "coverage":
    command += ["-O0", "--coverage", "-w"]
elif source and mode == "mutants":
    mutated = os.path.join(build, "core", "sources", places[source])
    if os.path.exists(mutated):
        at = command.index(source)
        command[at] = mutated
        command[1:1] = ["-I" + os.path.dirname(mutated), "-I" + os.path.dirname(source), f"-I{HERE}"]
        command += ["-O1", "-w", "-Wno-narrowing"]
elif shutil.which("ccache"):
    command.insert(0, "ccache")
    environment = {**os.environ, "CCACHE_BASEDIR": str(ROOT), "CCACHE_NOHASHDIR": "1"}
os.execvpe(command[0], command, environment)
