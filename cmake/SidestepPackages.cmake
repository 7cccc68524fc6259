# Debian packages, by CPack: one for each component of what is installed (tools/package.sh).
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME sidestep)
set(CPACK_PACKAGE_CONTACT "The Sidestep authors <sidestep@example.org>")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
  OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS ${CMAKE_LIBRARY_OUTPUT_DIRECTORY})
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS ON)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS_POLICY ">=")
set(CPACK_PRE_BUILD_SCRIPTS ${PROJECT_SOURCE_DIR}/cmake/stage_packages.cmake)
set(CPACK_SIDESTEP_SOURCE ${PROJECT_SOURCE_DIR})
set(CPACK_SIDESTEP_PACKAGES "")
set(CPACK_COMPONENTS_ALL "")

# sidestep_package(COMPONENT NAME section depends description)
# Depends names what dpkg-shlibdeps does not find. The description: a line, then a paragraph.
function(sidestep_package component name section depends summary text)
  string(TOUPPER ${component} key)
  set(CPACK_DEBIAN_${key}_PACKAGE_NAME ${name} PARENT_SCOPE)
  set(CPACK_DEBIAN_${key}_PACKAGE_SECTION ${section} PARENT_SCOPE)
  set(CPACK_DEBIAN_${key}_PACKAGE_DEPENDS ${depends} PARENT_SCOPE)
  set(CPACK_COMPONENT_${key}_DESCRIPTION "${summary}\n${text}" PARENT_SCOPE)
  set(CPACK_COMPONENTS_ALL ${CPACK_COMPONENTS_ALL} ${component} PARENT_SCOPE)
  set(CPACK_SIDESTEP_PACKAGES ${CPACK_SIDESTEP_PACKAGES} ${component}=${name} PARENT_SCOPE)
endfunction()

set(same "(= ${PROJECT_VERSION})")
set(library libsidestep${SIDESTEP_SOVERSION})
set(about "Sidestep maps an unknown scene from depth images and plans whole-body
motion of mobile manipulators through it, again and again while they move.")
sidestep_package(libraries ${library} libs ""
  "scene reconstruction and whole-body motion planning - libraries"
  "${about}\n.\nThis package contains the shared libraries.")
sidestep_package(plugins sidestep-plugins science "${library} ${same}"
  "scene reconstruction and whole-body motion planning - plugins"
  "${about}\n.\nThis package contains mappers, distance fields, planners, robots and
experiments, with their configurations.")
sidestep_package(command sidestep science "${library} ${same}, sidestep-plugins ${same}"
  "scene reconstruction and whole-body motion planning"
  "${about}\n.\nThis package contains the command, its viewer and the documentation.")
sidestep_package(development libsidestep-dev libdevel
  "${library} ${same}, sidestep ${same}, libeigen3-dev, libexpected-dev, nlohmann-json3-dev, libgtest-dev"
  "scene reconstruction and whole-body motion planning - development"
  "${about}\n.\nThis package contains headers, CMake files, and an example of each kind of
plugin with the suite that it passes.")
if(TARGET source_ros1)
  sidestep_package(plugins_ros1 sidestep-plugins-ros1 science "${library} ${same}, sidestep-plugins ${same}"
    "scene reconstruction and whole-body motion planning - ROS 1"
    "${about}\n.\nThis package contains the camera, the executor and the bags of ROS 1, and a
simulated robot.")
endif()
if(TARGET python_core)
  math(EXPR next_minor "${SIDESTEP_PYTHON_MINOR} + 1")
  sidestep_package(python python3-sidestep python
    "sidestep-plugins ${same}, python3 (>= 3.${SIDESTEP_PYTHON_MINOR}~), python3 (<< 3.${next_minor}), python3-numpy"
    "scene reconstruction and whole-body motion planning - Python"
    "${about}\n.\nThis package contains the Python module.")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_RECOMMENDS "python3-pandas, python3-matplotlib")
  # Byte code is written as the package is installed, and removed with it.
  file(CONFIGURE OUTPUT ${CMAKE_BINARY_DIR}/cmake/postinst @ONLY CONTENT
"#!/bin/sh
set -e
if [ \"$1\" = configure ] && command -v py3compile >/dev/null; then
  py3compile -p python3-sidestep
fi
")
  file(CONFIGURE OUTPUT ${CMAKE_BINARY_DIR}/cmake/prerm @ONLY CONTENT
"#!/bin/sh
set -e
if command -v py3clean >/dev/null; then
  py3clean -p python3-sidestep
fi
")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_CONTROL_EXTRA ${CMAKE_BINARY_DIR}/cmake/postinst ${CMAKE_BINARY_DIR}/cmake/prerm)
endif()
file(CONFIGURE OUTPUT ${CMAKE_BINARY_DIR}/cmake/triggers @ONLY CONTENT "activate-noawait ldconfig\n")
set(CPACK_DEBIAN_LIBRARIES_PACKAGE_CONTROL_EXTRA ${CMAKE_BINARY_DIR}/cmake/triggers)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_RECOMMENDS "cmake, g++")
set(CPACK_DEBIAN_COMMAND_PACKAGE_SUGGESTS "slurm-client")
include(CPack)
