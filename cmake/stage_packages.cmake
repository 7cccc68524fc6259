# CPack runs this once everything lies where it is packed from: adds what Debian wants in each package.
string(TIMESTAMP date "%a, %d %b %Y %H:%M:%S +0000" UTC)  # SOURCE_DATE_EPOCH, where it is set
file(READ ${CPACK_SIDESTEP_SOURCE}/LICENSE licence)

# As Debian's copyright files have a text: indented, with a full stop for an empty line.
function(indented text out)
  string(STRIP "${text}" text)
  string(REGEX REPLACE "\n[ \t]*\n" "\n.\n" text "${text}")
  string(REGEX REPLACE "\n[ \t]*\n" "\n.\n" text "${text}")
  string(REPLACE "\n" "\n " text "\n${text}")
  set(${out} "${text}" PARENT_SCOPE)
endfunction()

indented("${licence}" licence)
foreach(package IN LISTS CPACK_SIDESTEP_PACKAGES)
  string(REGEX MATCH "^(.*)=(.*)$" package ${package})
  set(root ${CPACK_TEMPORARY_INSTALL_DIRECTORY}/${CMAKE_MATCH_1}/usr)
  set(name ${CMAKE_MATCH_2})
  set(doc ${root}/share/doc/${name})
  set(copyright "Format: https://www.debian.org/doc/packaging-manuals/copyright-format/1.0/
Upstream-Name: Sidestep

Files: *
Copyright: 2026, the Sidestep authors
License: BSD-3-clause${licence}
")
  # The page holds what it was bundled from.
  file(GLOB licences ${root}/share/sidestep/viewer/licences/*)
  foreach(file IN LISTS licences)
    get_filename_component(bundled ${file} NAME)
    file(READ ${file} text)
    string(REGEX MATCH "Copyright [^\n]*" holder "${text}")
    indented("${text}" text)
    string(APPEND copyright "
Files: share/sidestep/viewer/*.js
Comment: holds the npm package ${bundled}
${holder}
License: ${bundled}${text}
")
  endforeach()
  file(WRITE ${doc}/copyright "${copyright}")
  file(WRITE ${doc}/changelog "sidestep (${CPACK_PACKAGE_VERSION}) unstable; urgency=medium

  * See CHANGELOG.md in the package sidestep.

 -- ${CPACK_PACKAGE_CONTACT}  ${date}
")
  file(GLOB manuals ${root}/share/man/man1/*.1)
  execute_process(COMMAND gzip -9nf ${doc}/changelog ${manuals} COMMAND_ERROR_IS_FATAL ANY)

  # The loader finds the libraries in /usr/lib.
  file(GLOB_RECURSE binaries ${root}/bin/* ${root}/lib/*.so* ${root}/lib/sidestep/sidestep_validate)
  foreach(binary IN LISTS binaries)
    if(NOT IS_SYMLINK ${binary})
      file(RPATH_REMOVE FILE ${binary})
    endif()
  endforeach()
endforeach()

# Who lacks a plugin of ROS is told which package has it.
set(not_built ${CPACK_TEMPORARY_INSTALL_DIRECTORY}/plugins/usr/lib/sidestep/plugins/not_built.txt)
file(GLOB libraries RELATIVE ${CPACK_TEMPORARY_INSTALL_DIRECTORY}/plugins_ros1/usr/lib/sidestep/plugins
  ${CPACK_TEMPORARY_INSTALL_DIRECTORY}/plugins_ros1/usr/lib/sidestep/plugins/*.so)
foreach(library IN LISTS libraries)
  string(REGEX REPLACE "lib([a-z]+)_(.*)\\.so" "\\1 \\2 sidestep-plugins-ros1\n" line ${library})
  file(APPEND ${not_built} ${line})
endforeach()
