# What `cmake --install` puts where, and the CMake package that third parties find.
include(CMakePackageConfigHelpers)

set(CMAKE_INSTALL_DEFAULT_COMPONENT_NAME development)
install(TARGETS sidestep_sdk sidestep_runtime EXPORT SidestepTargets
  LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT libraries NAMELINK_COMPONENT development)
install(DIRECTORY framework/include/sidestep DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
install(EXPORT SidestepTargets NAMESPACE Sidestep::
  DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/Sidestep)
file(RELATIVE_PATH SIDESTEP_PREFIX_OF_PC /${CMAKE_INSTALL_LIBDIR}/pkgconfig /)
configure_file(cmake/sidestep.pc.in ${CMAKE_BINARY_DIR}/cmake/sidestep.pc @ONLY)
install(FILES ${CMAKE_BINARY_DIR}/cmake/sidestep.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
configure_package_config_file(cmake/SidestepConfig.cmake.in
  ${CMAKE_BINARY_DIR}/cmake/SidestepConfig.cmake
  INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/Sidestep PATH_VARS CMAKE_INSTALL_BINDIR)
write_basic_package_version_file(${CMAKE_BINARY_DIR}/cmake/SidestepConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES
  ${CMAKE_BINARY_DIR}/cmake/SidestepConfig.cmake
  ${CMAKE_BINARY_DIR}/cmake/SidestepConfigVersion.cmake
  cmake/SidestepPlugin.cmake cmake/plugin_exports.map
  DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/Sidestep)

set(CMAKE_INSTALL_DEFAULT_COMPONENT_NAME command)
install(FILES CHANGELOG.md CONTRIBUTING.md LICENSE README.md DESTINATION ${CMAKE_INSTALL_DOCDIR})
install(DIRECTORY docs DESTINATION ${CMAKE_INSTALL_DOCDIR})
install(FILES package.xml DESTINATION ${CMAKE_INSTALL_DATADIR}/sidestep)  # ROS finds the launch files by it
install(FILES tools/sidestep/completion.bash RENAME sidestep
  DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions)

# A manual page for each command that is installed and each command of `sidestep`, of what `--help` says.
find_program(SIDESTEP_HELP2MAN help2man)
if(NOT SIDESTEP_HELP2MAN)
  message(STATUS "sidestep: no manual pages: install help2man")
elseif(NOT SIDESTEP_SANITIZE)
  set(manual ${CMAKE_BINARY_DIR}/share/man/man1)
  get_property(commands GLOBAL PROPERTY SIDESTEP_COMMANDS)
  add_custom_command(OUTPUT ${manual}/sidestep.1
    COMMAND ${PROJECT_SOURCE_DIR}/cmake/write_manual.sh ${manual} ${CMAKE_RUNTIME_OUTPUT_DIRECTORY} ${commands}
    DEPENDS cmake/write_manual.sh ${commands} VERBATIM COMMENT "Writing the manual pages")
  add_custom_target(sidestep_manual ALL DEPENDS ${manual}/sidestep.1)
  add_dependencies(sidestep_product sidestep_manual)
  install(DIRECTORY ${manual} DESTINATION ${CMAKE_INSTALL_MANDIR} OPTIONAL PATTERN fake_hsr.1 EXCLUDE)
  install(FILES ${manual}/fake_hsr.1 DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT plugins_ros1 OPTIONAL)
endif()
