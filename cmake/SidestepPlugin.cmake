# sidestep_add_plugin(NAME KIND kind SOURCES ... [LINK library...] [COMPONENT component])
#
# A Sidestep plugin: the shared library lib<kind>_<name>.so, whose one exported symbol is
# sidestep_plugin(). KIND is source, mapper, field, robot, optimiser, executor, cost, predictor, gaze, localiser
# or experiment, which links Sidestep::runtime, too. In a build of Sidestep itself it lands beside the others; elsewhere, in the
# current binary folder. Installed with Sidestep, for third parties too.
function(sidestep_add_plugin name)
  cmake_parse_arguments(ARG "" "KIND;COMPONENT" "SOURCES;LINK" ${ARGN})
  set(target ${ARG_KIND}_${name})
  if("sidestep_${name}" IN_LIST ARG_LINK)  # sidestep_add_plugin_library: the entry point is compiled with it
    target_sources(sidestep_${name} PRIVATE ${ARG_SOURCES})
    set(ARG_SOURCES $<TARGET_OBJECTS:sidestep_${name}>)
  endif()
  add_library(${target} MODULE ${ARG_SOURCES})
  target_compile_features(${target} PRIVATE cxx_std_20)
  set_target_properties(${target} PROPERTIES
    CXX_EXTENSIONS OFF
    LINKER_LANGUAGE CXX
    CXX_VISIBILITY_PRESET hidden
    VISIBILITY_INLINES_HIDDEN ON)
  target_link_libraries(${target} PRIVATE Sidestep::sdk ${ARG_LINK})
  if(ARG_KIND STREQUAL experiment)
    target_link_libraries(${target} PRIVATE Sidestep::runtime)
  endif()
  if(NOT SIDESTEP_SANITIZE)
    target_link_options(${target} PRIVATE LINKER:--no-undefined
      LINKER:--version-script,${CMAKE_CURRENT_FUNCTION_LIST_DIR}/plugin_exports.map)
  endif()
  if(COMMAND sidestep_warnings)  # inside Sidestep's own tree
    sidestep_warnings(${target})
    add_dependencies(sidestep_product ${target})
    sidestep_plugin_target(${name} ${target})
    set_property(GLOBAL APPEND PROPERTY SIDESTEP_PLUGINS_CONFIGURED "${ARG_KIND} ${name}")
    set_target_properties(${target} PROPERTIES
      LIBRARY_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/lib/sidestep/plugins
      INSTALL_RPATH "$ORIGIN/../..")
    if(NOT ARG_COMPONENT)
      set(ARG_COMPONENT plugins)
    endif()
    install(TARGETS ${target} LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR}/sidestep/plugins COMPONENT ${ARG_COMPONENT})
  endif()
endfunction()

# sidestep_add_plugin_tests(NAME KIND kind [SOURCES ...] [CASE file])
#
# Of a plugin that sidestep_add_plugin() made: the test <kind>_<NAME>.conformance holds it to the suite of its kind as the
# file describes it (`sidestep validate`), and the sources, on GoogleTest, are a program with the plugin's own objects.
function(sidestep_add_plugin_tests name)
  cmake_parse_arguments(ARG "" "KIND;CASE" "SOURCES" ${ARGN})
  set(target ${ARG_KIND}_${name})
  if(ARG_CASE)
    get_filename_component(ARG_CASE ${ARG_CASE} ABSOLUTE)
  endif()
  add_test(NAME ${target}.conformance
    COMMAND Sidestep::sidestep validate $<TARGET_FILE:${target}> ${ARG_CASE})
  if(ARG_SOURCES)
    find_package(GTest REQUIRED)
    include(GoogleTest)
    add_executable(${target}_test ${ARG_SOURCES} $<TARGET_OBJECTS:${target}>)
    target_compile_features(${target}_test PRIVATE cxx_std_20)
    target_link_libraries(${target}_test PRIVATE $<TARGET_PROPERTY:${target},LINK_LIBRARIES> GTest::gtest_main)
    gtest_discover_tests(${target}_test)
  endif()
endfunction()
