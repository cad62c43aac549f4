# The compiler of an older Debian with that Debian's C library, run on this machine: what it makes
# needs no younger C library than that one. The folder is made by fetch_toolchain.sh.
set(ORBSLAM2PY_SYSROOT "$ENV{ORBSLAM2PY_SYSROOT}")
if(NOT IS_DIRECTORY "${ORBSLAM2PY_SYSROOT}")
  message(FATAL_ERROR "ORBSLAM2PY_SYSROOT names no folder: run scripts/wheel/fetch_toolchain.sh FOLDER")
endif()
file(GLOB compilers "${ORBSLAM2PY_SYSROOT}/usr/bin/g++-[0-9]*")
list(GET compilers 0 CMAKE_CXX_COMPILER)
string(REPLACE "g++" "gcc" CMAKE_C_COMPILER "${CMAKE_CXX_COMPILER}")
# Its other tools need libraries of their own; this machine's do the same.
foreach(tool AR RANLIB NM STRIP OBJCOPY OBJDUMP READELF)
  string(TOLOWER "${tool}" name)
  find_program(ORBSLAM2PY_${tool} "${name}" PATHS /usr/bin NO_DEFAULT_PATH REQUIRED)
  set(CMAKE_${tool} "${ORBSLAM2PY_${tool}}" CACHE FILEPATH "This machine's ${name}")
endforeach()
set(CMAKE_SYSROOT "${ORBSLAM2PY_SYSROOT}")
# Nothing of the machine's own libraries; what is needed is named by full paths.
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
