# Fetches what package-lock.json names into the folder that this is run in.
execute_process(COMMAND ${npm} ci --ignore-scripts --no-audit --no-fund --loglevel=error
  RESULT_VARIABLE failed OUTPUT_VARIABLE output ERROR_VARIABLE output)
if(failed)
  message(FATAL_ERROR "${output}\nnpm could not fetch the packages of the viewer's page, which takes access "
    "to its registry once. Configure with -DSIDESTEP_VIEWER=OFF to build without the viewer.")
endif()
