# What `cmake --install` puts where, and the CMake package that third parties find.
include(CMakePackageConfigHelpers)

install(TARGETS sidestep_sdk sidestep_runtime EXPORT SidestepTargets
  LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(DIRECTORY framework/include/sidestep DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
install(EXPORT SidestepTargets NAMESPACE Sidestep::
  DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/Sidestep)
configure_package_config_file(cmake/SidestepConfig.cmake.in
  ${CMAKE_BINARY_DIR}/cmake/SidestepConfig.cmake
  INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/Sidestep)
write_basic_package_version_file(${CMAKE_BINARY_DIR}/cmake/SidestepConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES
  ${CMAKE_BINARY_DIR}/cmake/SidestepConfig.cmake
  ${CMAKE_BINARY_DIR}/cmake/SidestepConfigVersion.cmake
  cmake/SidestepPlugin.cmake cmake/plugin_exports.map
  DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/Sidestep)
