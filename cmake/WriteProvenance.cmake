# Writes provenance_config.hpp: cmake -DSOURCE=... -DVERSION=... -DFLAGS=... -DOUT=... -P this.
# Runs at every build; touches the file only when something in it has changed.
execute_process(COMMAND git -C ${SOURCE} rev-parse --short=12 HEAD
  OUTPUT_VARIABLE hash OUTPUT_STRIP_TRAILING_WHITESPACE RESULT_VARIABLE failed ERROR_QUIET)
if(failed)
  set(hash "unknown")
else()
  execute_process(COMMAND git -C ${SOURCE} status --porcelain --untracked-files=no
    OUTPUT_VARIABLE changes ERROR_QUIET)
  if(changes)
    string(APPEND hash "+")
  endif()
endif()
string(STRIP "${FLAGS}" FLAGS)
file(CONFIGURE OUTPUT ${OUT} CONTENT
"#pragma once
#define SIDESTEP_VERSION \"${VERSION}\"
#define SIDESTEP_GIT_HASH \"${hash}\"
#define SIDESTEP_BUILD_FLAGS \"${FLAGS}\"
")
