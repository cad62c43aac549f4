# One CMake target per folder of src/cpp. A folder links only the folders below it, so an include
# that points upwards does not compile or does not link.

add_library(orbslam_options INTERFACE)
target_compile_options(orbslam_options INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wno-sign-conversion)
if(ORBSLAM2PY_WERROR)
  target_compile_options(orbslam_options INTERFACE -Werror)
endif()
if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
  # A portable baseline for every translation unit that sees Eigen types; kernels for other vector
  # units are compiled with their own flags and include neither Eigen nor Ceres.
  include(CheckCXXCompilerFlag)
  check_cxx_compiler_flag(-march=x86-64-v2 ORBSLAM2PY_KNOWS_LEVELS)
  if(ORBSLAM2PY_KNOWS_LEVELS)
    target_compile_options(orbslam_options INTERFACE -march=x86-64-v2)
  else() # the same by its parts, for compilers older than the name (GCC 9)
    target_compile_options(orbslam_options INTERFACE
      -march=x86-64 -mcx16 -msahf -mpopcnt -msse3 -mssse3 -msse4.1 -msse4.2)
  endif()
else()
  # Where fused multiply-add is part of the baseline, contraction would change results.
  target_compile_options(orbslam_options INTERFACE -ffp-contract=off)
endif()
if(CMAKE_SYSTEM_PROCESSOR MATCHES "aarch64|arm64")
  target_include_directories(orbslam_options SYSTEM BEFORE INTERFACE ${PROJECT_SOURCE_DIR}/cmake/aarch64)
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    target_compile_options(orbslam_options INTERFACE -Wno-psabi) # notes on pairs, which GCC before 10.1 passed otherwise
  endif()
endif()
# Eigen asks the processor how large its caches are, and adds up long products by parts of that size. What it
# takes on x86-64 when it cannot ask is what most have.
target_compile_definitions(orbslam_options INTERFACE EIGEN_NO_CPUID EIGEN_DEFAULT_L1_CACHE_SIZE=32768)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  target_compile_options(orbslam_options INTERFACE -fpch-preprocess) # lets ccache see them
  # Kilobytes that may be in use before the compiler looks for what it could free: a tenth of its time,
  # and most sources never need more.
  target_compile_options(orbslam_options INTERFACE "SHELL:--param ggc-min-heapsize=400000")
endif()
# Of the folders' libraries alone. The programs of the tests are linked to them as they are compiled without
# sanitizers (tests/cpp/CMakeLists.txt).
add_library(orbslam_sanitizers INTERFACE)
if(ORBSLAM2PY_SANITIZE)
  target_compile_options(orbslam_sanitizers INTERFACE
    -fsanitize=${ORBSLAM2PY_SANITIZE} -fno-sanitize-recover=all -fno-omit-frame-pointer
    # These checks of each pointer double the compile time. The address sanitizer finds invalid pointers as well.
    -fno-sanitize=null,alignment,object-size,pointer-overflow,vptr
    -Wno-maybe-uninitialized)  # GCC 12 reports false ones inside instrumented library headers
  target_link_options(orbslam_options INTERFACE -fsanitize=${ORBSLAM2PY_SANITIZE})
  # Under the address sanitizer Eigen aligns memory itself, but not in libceres, which was compiled
  # without: what one allocates the other could not free.
  target_compile_definitions(orbslam_sanitizers INTERFACE EIGEN_MALLOC_ALREADY_ALIGNED=1)
endif()

# Parsing Eigen is most of what a small file costs the compiler.
set(ORBSLAM2PY_EIGEN_HEADERS <Eigen/Core> <Eigen/Geometry> <Eigen/LU>)

# Of sources that Highway compiles for several vector units. Some of those have fused multiply-add,
# whose results are not those of the others; plain C++ is what GCC's vectoriser got wrong before 12.3
# (its bug 106322).
set(ORBSLAM2PY_KERNEL_OPTIONS -ffp-contract=off)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 12.3)
  set(ORBSLAM2PY_PLAIN_KERNEL_OPTIONS -fno-tree-vectorize)
endif()
if(NOT CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64|aarch64|arm64")
  list(APPEND ORBSLAM2PY_KERNEL_OPTIONS ${ORBSLAM2PY_PLAIN_KERNEL_OPTIONS})
endif()

# orbslam_folder(NAME [SEPARATE] [DEPENDS folder...] [PUBLIC lib...] [PRIVATE lib...]
#                [ALONE source...] [KERNELS source...] [AVX2 source...])
# SEPARATE: each source is compiled by itself, also in a unity build; ALONE: these are. KERNELS: for every
# vector unit.
function(orbslam_folder NAME)
  cmake_parse_arguments(ARG "SEPARATE" "" "DEPENDS;PUBLIC;PRIVATE;ALONE;KERNELS;AVX2" ${ARGN})
  file(GLOB sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/${NAME}/*.cpp)
  list(TRANSFORM ARG_DEPENDS PREPEND orbslam_ OUTPUT_VARIABLE depends)
  if(sources)
    add_library(orbslam_${NAME} STATIC ${sources})
    set(archives orbslam_${NAME})
    foreach(folder ${depends})
      get_target_property(theirs ${folder} ORBSLAM2PY_ARCHIVES)
      list(APPEND archives ${theirs})
    endforeach()
    list(REMOVE_DUPLICATES archives)
    set_target_properties(orbslam_${NAME} PROPERTIES ORBSLAM2PY_ARCHIVES "${archives}")
    if(ARG_SEPARATE)
      set_target_properties(orbslam_${NAME} PROPERTIES UNITY_BUILD OFF)
    endif()
    target_link_libraries(orbslam_${NAME} PUBLIC ${depends} ${ARG_PUBLIC}
      PRIVATE orbslam_options orbslam_sanitizers ${ARG_PRIVATE})
    target_include_directories(orbslam_${NAME} PUBLIC ${CMAKE_CURRENT_SOURCE_DIR})
    if(NAME STREQUAL "base")
      target_precompile_headers(orbslam_base PRIVATE ${ORBSLAM2PY_EIGEN_HEADERS})
    else()
      target_precompile_headers(orbslam_${NAME} REUSE_FROM orbslam_base)
    endif()
    if(ORBSLAM2PY_SANITIZE)
      target_link_options(orbslam_${NAME} PUBLIC -fsanitize=${ORBSLAM2PY_SANITIZE})
    endif()
  else()
    add_library(orbslam_${NAME} INTERFACE)
    target_link_libraries(orbslam_${NAME} INTERFACE ${depends} ${ARG_PUBLIC})
    target_include_directories(orbslam_${NAME} INTERFACE ${CMAKE_CURRENT_SOURCE_DIR})
  endif()
  foreach(source ${ARG_ALONE})
    set_source_files_properties(${CMAKE_CURRENT_SOURCE_DIR}/${NAME}/${source}
      PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
  endforeach()
  foreach(source ${ARG_KERNELS})
    set_source_files_properties(${CMAKE_CURRENT_SOURCE_DIR}/${NAME}/${source}
      PROPERTIES COMPILE_OPTIONS "${ORBSLAM2PY_KERNEL_OPTIONS}"
      SKIP_PRECOMPILE_HEADERS ON SKIP_UNITY_BUILD_INCLUSION ON)
  endforeach()
  foreach(source ${ARG_AVX2})
    set_source_files_properties(${CMAKE_CURRENT_SOURCE_DIR}/${NAME}/${source}
      PROPERTIES COMPILE_OPTIONS "-mavx2" SKIP_PRECOMPILE_HEADERS ON SKIP_UNITY_BUILD_INCLUSION ON)
  endforeach()
endfunction()
