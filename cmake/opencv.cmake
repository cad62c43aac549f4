# The targets opencv_core and opencv_imgproc. An OpenCV that was built by its own CMake files says where it is
# (OpenCV_DIR). Debian has that in libopencv-dev alone, which is all of OpenCV and what that needs, 340 packages;
# libraries and headers of the two modules are in 50.
find_package(OpenCV QUIET COMPONENTS core imgproc)
if(NOT OpenCV_FOUND)
  find_path(OPENCV_INCLUDE_DIR opencv2/imgproc.hpp PATH_SUFFIXES opencv4)
  find_library(OPENCV_CORE_LIBRARY opencv_core)
  find_library(OPENCV_IMGPROC_LIBRARY opencv_imgproc)
  if(NOT OPENCV_INCLUDE_DIR OR NOT OPENCV_CORE_LIBRARY OR NOT OPENCV_IMGPROC_LIBRARY)
    message(FATAL_ERROR "OpenCV is missing (its modules core and imgproc).\n"
      "Install Debian's packages libopencv-core-dev and libopencv-imgproc-dev, or name the folder of "
      "OpenCVConfig.cmake: -DOpenCV_DIR=...")
  endif()
  foreach(module core imgproc)
    string(TOUPPER ${module} name)
    add_library(opencv_${module} UNKNOWN IMPORTED)
    set_target_properties(opencv_${module} PROPERTIES
      IMPORTED_LOCATION ${OPENCV_${name}_LIBRARY}
      INTERFACE_INCLUDE_DIRECTORIES ${OPENCV_INCLUDE_DIR})
  endforeach()
  set_property(TARGET opencv_imgproc PROPERTY INTERFACE_LINK_LIBRARIES opencv_core)
endif()
