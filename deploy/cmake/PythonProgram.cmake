# carillon_add_python_program(NAME main.py module...): a zip archive of Python modules and data, executable by Python; installed.
find_program(CARILLON_SYSTEM_PYTHON NAMES python3 PATHS /usr/bin NO_DEFAULT_PATH REQUIRED)
function(carillon_add_python_program name main)
  set(program ${CMAKE_RUNTIME_OUTPUT_DIRECTORY}/${name})
  set(folder ${CMAKE_CURRENT_BINARY_DIR}/modules)
  set(sources ${ARGN})
  list(TRANSFORM sources PREPEND ${CMAKE_CURRENT_SOURCE_DIR}/)
  set(main ${CMAKE_CURRENT_SOURCE_DIR}/${main})
  set(version_text ${PROJECT_BINARY_DIR}/runtime/base/version.txt)
  set(stamp ${PROJECT_SOURCE_DIR}/runtime/base/stamp.cmake)
  add_custom_command(OUTPUT ${program}
    COMMAND ${CMAKE_COMMAND} -E rm -rf ${folder}
    COMMAND ${CMAKE_COMMAND} -E make_directory ${CMAKE_RUNTIME_OUTPUT_DIRECTORY} ${folder}
    COMMAND ${CMAKE_COMMAND} -E copy_if_different ${sources} ${folder}
    COMMAND ${CMAKE_COMMAND} -DINPUT=${main} -DVERSION_TEXT=${version_text} -DOUTPUT=${folder}/__main__.py -P ${stamp}
    COMMAND ${CARILLON_SYSTEM_PYTHON} -m zipapp ${folder} --python /usr/bin/python3 --output ${program}
    COMMAND chmod 755 ${program}
    DEPENDS ${main} ${sources} ${version_text} ${stamp} carillon_git_id
    COMMENT "Packing ${name}")
  add_custom_target(${name} ALL DEPENDS ${program})
  install(PROGRAMS ${program} DESTINATION ${CMAKE_INSTALL_BINDIR})
endfunction()
