# Plugins of ours that lack something: the host names them, and what to install.

# sidestep_plugin_not_built(NAME KIND kind PACKAGES package...)
# Instead of sidestep_add_plugin(), where what the plugin needs is not there.
function(sidestep_plugin_not_built name)
  cmake_parse_arguments(ARG "" "KIND" "PACKAGES" ${ARGN})
  list(JOIN ARG_PACKAGES " " packages)
  set_property(GLOBAL APPEND PROPERTY SIDESTEP_PLUGINS_NOT_BUILT "${ARG_KIND} ${name} ${packages}")
  sidestep_plugin_target(${name})
  message(STATUS "Plugin ${name} is not built: install ${packages}")
endfunction()

# Writes not_built.txt beside the plugins, `KIND NAME PACKAGE...` a line; and, in the build tree alone,
# configured.txt, `KIND NAME` a line: those that a build of everything has.
function(sidestep_write_plugins_not_built)
  get_property(lines GLOBAL PROPERTY SIDESTEP_PLUGINS_NOT_BUILT)
  list(JOIN lines "\n" text)
  set(file ${CMAKE_BINARY_DIR}/lib/sidestep/plugins/not_built.txt)
  file(CONFIGURE OUTPUT ${file} CONTENT "${text}\n" @ONLY)
  get_property(configured GLOBAL PROPERTY SIDESTEP_PLUGINS_CONFIGURED)
  list(JOIN configured "\n" text)
  file(CONFIGURE OUTPUT ${CMAKE_BINARY_DIR}/lib/sidestep/plugins/configured.txt CONTENT "${text}\n" @ONLY)
  install(FILES ${file} DESTINATION ${CMAKE_INSTALL_LIBDIR}/sidestep/plugins COMPONENT plugins)
endfunction()
