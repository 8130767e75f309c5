# Joins the script of a thread and its import into one file for a page's bundler:
# cmake -DMODULE=carillon-wasm.js -DSCRIPT=carillon-worker.js -DTO=file -P join.cmake
file(READ ${MODULE} module)
file(READ ${SCRIPT} script)
get_filename_component(name ${MODULE} NAME)
string(REGEX REPLACE "import [^\n]* from './${name}';\n" "" rest "${script}")
if(rest STREQUAL script)
  message(FATAL_ERROR "${SCRIPT} imports nothing from ${name}; copy it instead")
endif()
string(REGEX REPLACE "\nexport " "\n" module "${module}")
file(WRITE ${TO} "${module}\n${rest}")
