# How everything in this tree is compiled, and helpers for its targets.

set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)

set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin)
set(CMAKE_LIBRARY_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/lib)

find_program(SIDESTEP_CCACHE ccache)
if(SIDESTEP_CCACHE AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  # What was compiled in one checkout is found in another one: nothing that is hashed names its folder.
  set(CMAKE_CXX_COMPILER_LAUNCHER
    ${CMAKE_COMMAND} -E env CCACHE_BASEDIR=${PROJECT_SOURCE_DIR} CCACHE_NOHASHDIR=1 ${SIDESTEP_CCACHE})
  add_compile_options($<$<COMPILE_LANGUAGE:CXX>:-fmacro-prefix-map=${PROJECT_SOURCE_DIR}/=>)
endif()

set(SIDESTEP_SANITIZE "" CACHE STRING "Sanitizers for -fsanitize=, e.g. address,undefined")
if(SIDESTEP_SANITIZE)
  add_compile_options(-fsanitize=${SIDESTEP_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all)
  add_link_options(-fsanitize=${SIDESTEP_SANITIZE})
  if(SIDESTEP_SANITIZE MATCHES thread)
    # Else a library may find what the standard library has inline, as a shared_ptr's release, in a library of the
    # system, whose atomic operations ThreadSanitizer does not see.
    add_link_options(-Wl,-Bsymbolic-functions)
  endif()
endif()

# Kernels compute with vectors of 64 bytes. Where the processor's are shorter, g++ 12 keeps them in memory and by
# default moves them in parts of 16 bytes, which wait for what was written in parts of 32.
include(CheckCXXCompilerFlag)
check_cxx_compiler_flag("-mmove-max=256 -mstore-max=256" SIDESTEP_HAS_MOVE_MAX)
if(SIDESTEP_HAS_MOVE_MAX)
  add_compile_options($<$<COMPILE_LANGUAGE:CXX>:-mmove-max=256> $<$<COMPILE_LANGUAGE:CXX>:-mstore-max=256>)
endif()

# g++ looks for garbage of its own from 128 MB on. With memory for all that it makes of a source, up to 2 GB, it need
# not: a tenth less time to compile.
cmake_host_system_information(RESULT cores QUERY NUMBER_OF_LOGICAL_CORES)
cmake_host_system_information(RESULT memory_mb QUERY TOTAL_PHYSICAL_MEMORY)
if(EXISTS /sys/fs/cgroup/memory.max)  # a container's
  file(READ /sys/fs/cgroup/memory.max limit)
  if(limit MATCHES "^[0-9]+")
    math(EXPR limit_mb "${CMAKE_MATCH_0} / 1048576")
    if(limit_mb LESS memory_mb)
      set(memory_mb ${limit_mb})
    endif()
  endif()
endif()
math(EXPR memory_per_core_mb "${memory_mb} / ${cores}")
if(CMAKE_CXX_COMPILER_ID STREQUAL GNU AND memory_per_core_mb GREATER 4000)
  add_compile_options($<$<COMPILE_LANGUAGE:CXX>:--param=ggc-min-heapsize=4000000>)
endif()

# Warnings are errors for our own code only. -Wrestrict is wrong about std::string in g++ 12
# (GCC bug 105329). Sources that are compiled together are headers to g++, in which it wants no anonymous namespaces.
function(sidestep_warnings target)
  target_compile_options(${target} PRIVATE
    -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Woverloaded-virtual -Wno-missing-field-initializers -Werror)
  if(CMAKE_CXX_COMPILER_ID STREQUAL GNU)
    target_compile_options(${target} PRIVATE -Wno-restrict -Wno-subobject-linkage)
    if(SIDESTEP_SANITIZE)
      # What sanitizers add makes g++ warn of variables that are set (see -fsanitize in its manual).
      target_compile_options(${target} PRIVATE -Wno-maybe-uninitialized -Wno-uninitialized)
    endif()
  endif()
endfunction()

# For code that waits for nothing but the libraries that it calls, as tests and the command do: a
# third less time to compile.
function(sidestep_optimise_little target)
  target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:-O1>)
endfunction()

# sidestep_kernels(SOURCE...)
# Of this folder, those whose kernels are compiled once for each instruction set: they include themselves
# (core/each_target.hpp).
function(sidestep_kernels)
  set_source_files_properties(${ARGN} PROPERTIES
    INCLUDE_DIRECTORIES ${CMAKE_CURRENT_SOURCE_DIR} SKIP_UNITY_BUILD_INCLUSION ON)
endfunction()

# sidestep_add_layer(NAME SOURCES ... [LINK library...])
# One layer of the framework: an object library that becomes part of libsidestep_sdk or
# libsidestep_runtime.
function(sidestep_add_layer name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  add_library(sidestep_layer_${name} OBJECT ${ARG_SOURCES})
  target_include_directories(sidestep_layer_${name} PUBLIC
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/framework/include>)
  target_link_libraries(sidestep_layer_${name} PUBLIC Eigen3::Eigen tl::expected PRIVATE ${ARG_LINK})
  sidestep_warnings(sidestep_layer_${name})
endfunction()

# sidestep_add_plugin_library(NAME SOURCES ... [LINK library...])
# What one of our plugins consists of without its descriptor, as the static library sidestep_<NAME>:
# tests and benchmarks call it directly, the plugin itself adds the entry point.
function(sidestep_add_plugin_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  set(target sidestep_${name})
  add_library(${target} STATIC ${ARG_SOURCES})
  target_include_directories(${target} PUBLIC ${CMAKE_CURRENT_SOURCE_DIR})
  target_link_libraries(${target} PUBLIC Sidestep::sdk ${ARG_LINK})
  set_target_properties(${target} PROPERTIES
    CXX_VISIBILITY_PRESET hidden VISIBILITY_INLINES_HIDDEN ON)
  sidestep_warnings(${target})
endfunction()

# sidestep_plugin_target(NAME [target])
# The target plugin_<NAME> builds the plugins of that name, of whatever kind, as far as they can be built.
function(sidestep_plugin_target name)
  if(NOT TARGET plugin_${name})
    add_custom_target(plugin_${name})
  endif()
  if(ARGN)
    add_dependencies(plugin_${name} ${ARGN})
  endif()
endfunction()

# sidestep_add_command(NAME SOURCES ... [LINK library...] [COMPONENT component])
# A program that is installed, and so part of sidestep_product. It finds its libraries from where it
# lies.
function(sidestep_add_command name)
  cmake_parse_arguments(ARG "" "COMPONENT" "SOURCES;LINK" ${ARGN})
  if(NOT ARG_COMPONENT)
    set(ARG_COMPONENT command)
  endif()
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_LINK})
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR}/tools)
  set_target_properties(${name} PROPERTIES INSTALL_RPATH "$ORIGIN/../${CMAKE_INSTALL_LIBDIR}")
  sidestep_warnings(${name})
  sidestep_optimise_little(${name})
  install(TARGETS ${name} RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT ${ARG_COMPONENT})
  set_property(GLOBAL APPEND PROPERTY SIDESTEP_COMMANDS ${name})
  add_dependencies(sidestep_product ${name})
endfunction()

# sidestep_add_test(NAME SOURCES ... [LINK library...] [LABELS label...] [SERIAL])
# A GoogleTest executable whose cases become ctest tests. ThreadSanitizer runs those with the label `threads`,
# AddressSanitizer in CI those with the label `safety`: what decides whether a robot may move, and what reads files. The targets
# sidestep_threads_tests and sidestep_safety_tests build them. SERIAL: beside no other test.
function(sidestep_add_test name)
  if(NOT SIDESTEP_TESTS)
    return()
  endif()
  cmake_parse_arguments(ARG "SERIAL" "" "SOURCES;LINK;LABELS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  # The headers of GoogleTest, Eigen and the SDK take most of the time: read once for all sources,
  # but where clang-tidy wants an entry for each.
  option(SIDESTEP_TEST_BATCHES "Compile the sources of each test together" ON)
  set_target_properties(${name} PROPERTIES UNITY_BUILD ${SIDESTEP_TEST_BATCHES} UNITY_BUILD_BATCH_SIZE 0)
  target_link_libraries(${name} PRIVATE GTest::gtest_main GTest::gmock ${ARG_LINK})
  target_compile_definitions(${name} PRIVATE
    SIDESTEP_SOURCE_DIR="${PROJECT_SOURCE_DIR}"
    SIDESTEP_SHARED_DATA="${PROJECT_SOURCE_DIR}/../shared/data"
    SIDESTEP_SHARED_FACTS="${PROJECT_SOURCE_DIR}/../shared/facts")
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR}/tests)
  sidestep_warnings(${name})
  sidestep_optimise_little(${name})
  if(NOT ARG_LABELS)
    set(ARG_LABELS unit)
  endif()
  foreach(label IN ITEMS threads safety)
    if(label IN_LIST ARG_LABELS)
      add_dependencies(sidestep_${label}_tests ${name})
    endif()
  endforeach()
  list(JOIN ARG_LABELS "_" labels)  # one label that -L finds by each: of several, CMake keeps the first
  gtest_discover_tests(${name} DISCOVERY_MODE PRE_TEST DISCOVERY_TIMEOUT 60
    PROPERTIES LABELS "${labels}" TIMEOUT 600 RUN_SERIAL ${ARG_SERIAL})
endfunction()

# sidestep_add_benchmark(NAME SOURCES ... [LINK library...])
# A google-benchmark executable; ctest runs each for an instant so that none rots.
function(sidestep_add_benchmark name)
  if(NOT SIDESTEP_BENCHMARKS)
    return()
  endif()
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE benchmark::benchmark_main ${ARG_LINK})
  target_compile_definitions(${name} PRIVATE
    SIDESTEP_SOURCE_DIR="${PROJECT_SOURCE_DIR}"
    SIDESTEP_SHARED_DATA="${PROJECT_SOURCE_DIR}/../shared/data")
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR}/tests)
  sidestep_warnings(${name})
  if(SIDESTEP_TESTS)
    add_test(NAME benchmark.${name} COMMAND ${name} --benchmark_min_time=0.001)
    set_tests_properties(benchmark.${name} PROPERTIES LABELS benchmark TIMEOUT 300)
  endif()
endfunction()

# Adds every subfolder that has a CMakeLists.txt, in the order of their names.
function(sidestep_add_subfolders)
  file(GLOB lists CONFIGURE_DEPENDS RELATIVE ${CMAKE_CURRENT_SOURCE_DIR} */CMakeLists.txt)
  foreach(list IN LISTS lists)
    get_filename_component(folder ${list} DIRECTORY)
    add_subdirectory(${folder})
  endforeach()
endfunction()
