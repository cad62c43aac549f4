# orbslam_entry_point_only(TARGET): an extension module that shows nothing but PyInit_*. Another OpenCV or
# Ceres in the process sees nothing of those that are linked in here.
function(orbslam_entry_point_only TARGET)
  if(ORBSLAM2PY_SANITIZE)
    return()
  endif()
  set(map ${PROJECT_SOURCE_DIR}/cmake/entry_point.map)
  target_link_options(${TARGET} PRIVATE
    LINKER:--exclude-libs,ALL LINKER:--gc-sections LINKER:--version-script=${map})
  set_property(TARGET ${TARGET} APPEND PROPERTY LINK_DEPENDS ${map})
endfunction()
