# Products around the core: docs/components.md. Of one that is OFF no source is compiled and no test is registered; a job, scene or bank that
# needs it is refused with one sentence (runtime/base/component.hpp). tests/structure/include_law.py reads the table, too.

# carillon_component(NAME "what it adds" PATHS...): the option CARILLON_NAME, and the folders and files that are its own.
set(CARILLON_COMPONENTS)
set(CARILLON_ALL_COMPONENTS)  # lower case
set(CARILLON_COMPONENTS_OFF)
macro(carillon_component name sentence)
  option(CARILLON_${name} "Build ${sentence}" ON)
  list(APPEND CARILLON_COMPONENTS ${name})
  string(TOLOWER ${name} lower)
  list(APPEND CARILLON_ALL_COMPONENTS ${lower})
  set(CARILLON_PATHS_${name} ${ARGN})
  if(NOT CARILLON_${name})
    list(APPEND CARILLON_COMPONENTS_OFF ${name})
  endif()
endmacro()

carillon_component(SIMULATION "full-order motion of bodies and its sound, carillon-simulate" precompute/simulation)
carillon_component(AIR "boundary elements of the air outside a body" precompute/air precompute/run/air.cpp)
carillon_component(NONLINEAR "modes that large motion couples" precompute/coupling precompute/run/coupling.cpp runtime/synth/nonlinear
  runtime/synth/nonlinear_modes.cpp)
carillon_component(THIN_WALLS "extruded meshes of thin walls" precompute/mesher/thin_wall.cpp precompute/mesher/extrude.cpp
  precompute/mesher/extrude.hpp precompute/mesher/remesh.cpp precompute/mesher/skin.cpp precompute/mesher/skin.hpp
  precompute/mesher/skin_editor.cpp precompute/mesher/skin_editor.hpp precompute/mesher/skin_mitres.cpp)
carillon_component(ANALYTIC "bodies with known modes" precompute/analytic precompute/run/known_body.cpp)
carillon_component(PAGE "the web page of carillon explore and its sound engine" jobs/front/explore runtime/bindings/web)
carillon_component(EXCHANGE "banks and modes in formats of other programs, glTF scenes, samples"
  runtime/exchange/commands.cpp runtime/exchange/faust.hpp runtime/exchange/frf.cpp runtime/exchange/frf.hpp runtime/exchange/from_frd.cpp
  runtime/exchange/from_glb.cpp runtime/exchange/from_pch.cpp runtime/exchange/from_uff.cpp runtime/exchange/from_unv.cpp
  runtime/exchange/generalised_mass.cpp runtime/exchange/glb.hpp runtime/exchange/glb_multipoles.cpp runtime/exchange/glb_multipoles.hpp
  runtime/exchange/gltf_contacts.cpp runtime/exchange/gltf_contacts.hpp runtime/exchange/gltf_folder.cpp runtime/exchange/gltf_frames.hpp
  runtime/exchange/gltf_geometry.cpp runtime/exchange/gltf_geometry.hpp runtime/exchange/gltf_scene.cpp runtime/exchange/gltf_scene.hpp
  runtime/exchange/measured.cpp runtime/exchange/measured.hpp runtime/exchange/results_lines.hpp runtime/exchange/scale_rule.cpp
  runtime/exchange/scale_rule.hpp runtime/exchange/silent.cpp runtime/exchange/silent.hpp runtime/exchange/sofa.hpp
  runtime/exchange/solid.cpp runtime/exchange/solid.hpp runtime/exchange/solved_model.cpp runtime/exchange/solved_model.hpp
  runtime/exchange/struck_point.cpp runtime/exchange/struck_point.hpp runtime/exchange/to_faust.cpp runtime/exchange/to_glb.cpp
  runtime/exchange/to_sofa.cpp runtime/exchange/to_uff.cpp runtime/render/gltf_input.cpp runtime/render/samples)
carillon_component(SLURM "jobs in Slurm" jobs/queue/slurm jobs/cli/slurm.cpp)
carillon_component(HEADS "listeners with a head" runtime/acoustics/head runtime/synth/head_ears.cpp)
carillon_component(STUDIES "advice, scaling studies and bodies matched to recordings: carillon-study, carillon-tune" jobs/study jobs/tune)

# The component of a folder or file of the product, by its path from the root; empty: the core.
function(carillon_find_component out path)
  set(${out} "" PARENT_SCOPE)
  foreach(name ${CARILLON_COMPONENTS})
    foreach(own ${CARILLON_PATHS_${name}})
      string(FIND "${path}/" "${own}/" at)
      if(at EQUAL 0)
        set(${out} ${name} PARENT_SCOPE)
      endif()
    endforeach()
  endforeach()
endfunction()

# add_subdirectory() of those of the folders that are built. A folder of tests needs the component of the folder that it tests, or that
# before a colon: AIR:air.
function(carillon_add_folders)
  foreach(folder ${ARGN})
    if(folder MATCHES "(.+):(.+)")
      set(component ${CMAKE_MATCH_1})
      set(folder ${CMAKE_MATCH_2})
    else()
      cmake_path(RELATIVE_PATH CMAKE_CURRENT_SOURCE_DIR BASE_DIRECTORY ${PROJECT_SOURCE_DIR} OUTPUT_VARIABLE path)
      string(REGEX REPLACE "^(tests/unit|[.])/" "" path ${path}/${folder})
      carillon_find_component(component ${path})
    endif()
    string(TOLOWER "${component}" CARILLON_TEST_COMPONENTS)
    if(NOT component IN_LIST CARILLON_COMPONENTS_OFF)
      add_subdirectory(${folder})
    endif()
  endforeach()
endfunction()

# Absolute paths of the sources, relative to a folder, without those of components that are OFF. Where there is an x_absent.cpp next to
# x.cpp, it stands in.
function(carillon_select_sources out folder)
  set(kept)
  foreach(source ${ARGN})
    cmake_path(ABSOLUTE_PATH source BASE_DIRECTORY ${folder})
    string(REPLACE ${CMAKE_BINARY_DIR}/ ${PROJECT_SOURCE_DIR}/ file ${source})  # a generated one
    cmake_path(RELATIVE_PATH file BASE_DIRECTORY ${PROJECT_SOURCE_DIR} OUTPUT_VARIABLE path)
    carillon_find_component(component ${path})
    string(REGEX REPLACE "[.]cpp$" "_absent.cpp" absent ${file})
    if(NOT component IN_LIST CARILLON_COMPONENTS_OFF)
      list(APPEND kept ${source})
    elseif(EXISTS ${absent})
      list(APPEND kept ${absent})
    endif()
  endforeach()
  set(${out} ${kept} PARENT_SCOPE)
endfunction()

# carillon_lacks(VARIABLE name...): true if one of these components is OFF.
function(carillon_lacks out)
  set(${out} OFF PARENT_SCOPE)
  foreach(component ${ARGN})
    string(TOUPPER ${component} name)
    if(NOT name IN_LIST CARILLON_COMPONENTS)
      message(FATAL_ERROR "there is no component ${component}: deploy/cmake/Components.cmake")
    elseif(name IN_LIST CARILLON_COMPONENTS_OFF)
      set(${out} ON PARENT_SCOPE)
    endif()
  endforeach()
endfunction()
