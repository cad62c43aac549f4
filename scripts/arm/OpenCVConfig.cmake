# OpenCV's core and imgproc of the folder of arm64 libraries (toolchain.cmake).
foreach(module core imgproc)
  if(NOT TARGET opencv_${module})
    add_library(opencv_${module} SHARED IMPORTED)
    set_target_properties(opencv_${module} PROPERTIES
      IMPORTED_LOCATION "${CMAKE_SYSROOT}/usr/lib/aarch64-linux-gnu/libopencv_${module}.so"
      INTERFACE_INCLUDE_DIRECTORIES "${CMAKE_SYSROOT}/usr/include/opencv4")
  endif()
endforeach()
set_property(TARGET opencv_imgproc PROPERTY INTERFACE_LINK_LIBRARIES opencv_core)
