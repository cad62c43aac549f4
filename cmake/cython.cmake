# orbslam_cython_module(NAME SOURCE): compiles a .pyx of the Python package into an extension
# module that is installed beside it, in the room where its source lies.
function(orbslam_cython_module NAME SOURCE)
  set(generated ${CMAKE_CURRENT_BINARY_DIR}/${NAME}.cpp)
  add_custom_command(
    OUTPUT ${generated}
    COMMAND ${Python_EXECUTABLE} -m cython --cplus -3 ${SOURCE} -o ${generated}
    DEPENDS ${SOURCE}
    COMMENT "Cythonizing ${NAME}")
  Python_add_library(${NAME} MODULE WITH_SOABI ${generated})
  target_include_directories(${NAME} PRIVATE ${PROJECT_SOURCE_DIR}/src/cpp)
  # Generated code does not follow our warning rules.
  target_compile_options(${NAME} PRIVATE -O3 -w)
  orbslam_entry_point_only(${NAME})
  get_filename_component(folder ${SOURCE} DIRECTORY)
  file(RELATIVE_PATH room ${PROJECT_SOURCE_DIR}/src ${folder})
  install(TARGETS ${NAME} DESTINATION ${room} COMPONENT python)
  add_dependencies(orbslam2py_python ${NAME})
endfunction()
