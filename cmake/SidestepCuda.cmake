# CUDA, where its compiler is installed. Plugins that run on a GPU need nothing else of it: no GPU, no
# driver. The bodies of their kernels are C++ that tests run on the CPU, with or without CUDA.
#
# SIDESTEP_CUDA_COMPILED     whether .cu files can be compiled
# SIDESTEP_CUDA_PACKAGES     what to install where they cannot

option(SIDESTEP_CUDA "Build what runs on a GPU, where nvcc is installed" ON)
# By default portable code that the driver translates, once, for whatever GPU it finds: each architecture
# named takes another compilation of all kernels.
set(SIDESTEP_CUDA_ARCHITECTURES "75-virtual" CACHE STRING
  "GPUs to build for, from 75 (Turing) to 121, as CMAKE_CUDA_ARCHITECTURES: 75-virtual for any, 90 for an H200, native for the one in this machine, all-major")
set(SIDESTEP_CUDA_PACKAGES cuda-nvcc-13-0 cuda-cudart-dev-13-0)
set(SIDESTEP_CUDA_COMPILED OFF)

# nvcc knows no sanitizers.
if(SIDESTEP_CUDA AND NOT SIDESTEP_SANITIZE)
  if(NOT CMAKE_CUDA_COMPILER AND NOT DEFINED ENV{CUDACXX})
    # Where NVIDIA's packages leave it, which is not in everybody's PATH.
    find_program(SIDESTEP_NVCC nvcc HINTS /usr/local/cuda/bin)
    mark_as_advanced(SIDESTEP_NVCC)
    if(SIDESTEP_NVCC)
      set(ENV{CUDACXX} ${SIDESTEP_NVCC})  # for check_language(), which tries it out
    endif()
  endif()
  set(CMAKE_CUDA_ARCHITECTURES ${SIDESTEP_CUDA_ARCHITECTURES})
  if(NOT CMAKE_CUDA_HOST_COMPILER)
    set(CMAKE_CUDA_HOST_COMPILER ${CMAKE_CXX_COMPILER})
  endif()
  include(CheckLanguage)
  check_language(CUDA)
  if(CMAKE_CUDA_COMPILER)
    enable_language(CUDA)
    if(CMAKE_CUDA_COMPILER_VERSION VERSION_LESS 12.0)  # knows no C++20
      message(STATUS "nvcc ${CMAKE_CUDA_COMPILER_VERSION} is too old: 12.0 is needed")
    else()
      if(NOT CMAKE_CUDA20_STANDARD_COMPILE_OPTION)  # CMake 3.25 does not know it of nvcc
        set(CMAKE_CUDA20_STANDARD_COMPILE_OPTION -std=c++20)
      endif()
      set(CMAKE_CUDA_STANDARD 20)
      set(CMAKE_CUDA_STANDARD_REQUIRED ON)
      set(CMAKE_CUDA_EXTENSIONS OFF)
      if(SIDESTEP_CCACHE AND NOT CMAKE_CUDA_COMPILER_LAUNCHER)
        set(CMAKE_CUDA_COMPILER_LAUNCHER ${SIDESTEP_CCACHE})
      endif()
      set(SIDESTEP_CUDA_COMPILED ON)
    endif()
  endif()
endif()

# sidestep_add_kernel_library(NAME SOURCES ...)
# The static library sidestep_<NAME> of what runs kernels on the host, compiled as the device's are: no
# multiplication is fused with an addition.
function(sidestep_add_kernel_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES" ${ARGN})
  add_library(sidestep_${name} STATIC ${ARG_SOURCES})
  target_include_directories(sidestep_${name} PUBLIC ${CMAKE_CURRENT_SOURCE_DIR})
  target_link_libraries(sidestep_${name} PUBLIC sidestep_cuda_kernels)
  target_compile_options(sidestep_${name} PRIVATE -ffp-contract=off)
  set_target_properties(sidestep_${name} PROPERTIES
    CXX_VISIBILITY_PRESET hidden VISIBILITY_INLINES_HIDDEN ON)
  sidestep_warnings(sidestep_${name})
endfunction()

# sidestep_add_cuda_library(NAME SOURCES ... [LINK library...])
# The static library sidestep_<NAME> of .cu files, whose arithmetic is that of the same bodies on the
# CPU: no multiplication is fused with an addition.
function(sidestep_add_cuda_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  set(target sidestep_${name})
  add_library(${target} STATIC ${ARG_SOURCES})
  target_link_libraries(${target} PUBLIC ${ARG_LINK})
  target_compile_options(${target} PRIVATE
    $<$<COMPILE_LANGUAGE:CUDA>:--fmad=false;-Xcompiler=-Wall,-Wextra,-Werror>
    $<$<COMPILE_LANGUAGE:CXX>:-Wall;-Wextra;-Werror>)
  set_target_properties(${target} PROPERTIES
    CXX_VISIBILITY_PRESET hidden CUDA_VISIBILITY_PRESET hidden VISIBILITY_INLINES_HIDDEN ON CUDA_RUNTIME_LIBRARY Static)
endfunction()
