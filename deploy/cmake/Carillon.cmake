# How a Carillon library, program or test is declared.

include(GoogleTest)

# ---- compiler cache and linker: used where found (deploy/install build) ----

option(CARILLON_CCACHE "Compile through ccache, where it is installed" ON)
find_program(CARILLON_CCACHE_PROGRAM ccache)
if(CARILLON_CCACHE AND CARILLON_CCACHE_PROGRAM AND PROJECT_IS_TOP_LEVEL AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  # A clone in another folder hits: paths below the clone are hashed relative to it. The sloppiness is that of precompiled headers.
  set(CARILLON_LAUNCHER ${CMAKE_COMMAND} -E env CCACHE_BASEDIR=${PROJECT_SOURCE_DIR} CCACHE_NOHASHDIR=1
    CCACHE_SLOPPINESS=pch_defines,time_macros,include_file_mtime,include_file_ctime ${CARILLON_CCACHE_PROGRAM})
  set(CMAKE_C_COMPILER_LAUNCHER ${CARILLON_LAUNCHER})
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CARILLON_LAUNCHER})
endif()
find_program(CARILLON_MOLD mold)
if(CARILLON_MOLD AND PROJECT_IS_TOP_LEVEL)
  add_link_options(-fuse-ld=mold)
endif()

# ---- sources compiled together, and precompiled headers: both save most of what parsing the same headers again costs ----

option(CARILLON_UNITY "Compile the sources of a target together, about 60 kB at a time (half the CPU time of a build from nothing)" ON)
# Without optimisation gcc 12 reads intrinsics behind a precompiled header as if it optimised, and refuses Eigen's prefetches.
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND NOT CMAKE_BUILD_TYPE STREQUAL "Debug")
  set(precompiles ON)
endif()
option(CARILLON_PRECOMPILE "Precompile the standard headers (gcc only)" ${precompiles})
if(CARILLON_PRECOMPILE)
  add_compile_options($<$<COMPILE_LANGUAGE:CXX>:-fpch-preprocess>)  # or ccache would not cache
endif()

# Sources of `target` become units, files that include them by their path from the root: units of two clones are equal, so ccache hits.
# A source with options or definitions of its own, or one that is generated, stays alone.
function(carillon_unite target)
  get_target_property(sources ${target} SOURCES)
  get_target_property(folder ${target} SOURCE_DIR)
  set(alone)
  set(units)
  set(lines "")
  set(bytes 0)
  macro(carillon_close_unit)
    if(NOT lines STREQUAL "")
      list(LENGTH units count)
      set(unit ${CMAKE_BINARY_DIR}/units/${target}/${count}.cpp)
      file(CONFIGURE OUTPUT ${unit} CONTENT "${lines}" @ONLY)
      list(APPEND units ${unit})
      set(lines "")
      set(bytes 0)
    endif()
  endmacro()
  foreach(source ${sources})
    cmake_path(ABSOLUTE_PATH source BASE_DIRECTORY ${folder} OUTPUT_VARIABLE path)
    set(is_alone OFF)
    foreach(property COMPILE_OPTIONS COMPILE_DEFINITIONS COMPILE_FLAGS SKIP_UNITY_BUILD_INCLUSION)
      get_source_file_property(value ${path} TARGET_DIRECTORY ${target} ${property})
      if(value)
        set(is_alone ON)
      endif()
    endforeach()
    cmake_path(IS_PREFIX PROJECT_SOURCE_DIR ${path} is_inside)
    cmake_path(IS_PREFIX CMAKE_BINARY_DIR ${path} is_generated)
    if(is_alone OR NOT is_inside OR is_generated OR NOT path MATCHES "[.]cpp$")
      list(APPEND alone ${source})
      continue()
    endif()
    file(SIZE ${path} size)
    math(EXPR bytes "${bytes} + ${size}")
    cmake_path(RELATIVE_PATH path BASE_DIRECTORY ${PROJECT_SOURCE_DIR})
    string(APPEND lines "#include \"${path}\"\n")
    if(bytes GREATER 60000)
      carillon_close_unit()
    endif()
  endforeach()
  carillon_close_unit()
  set_target_properties(${target} PROPERTIES SOURCES "${units};${alone}")
endfunction()

# What is compiled with other macros or position independent needs its own precompiled header. KIND: plain, pic, loops (pic, no errno of
# mathematical functions) or test.
function(carillon_precompiled kind)
  set(name carillon_precompiled_${kind})
  if(TARGET ${name})
    return()
  endif()
  add_library(${name} OBJECT ${PROJECT_SOURCE_DIR}/deploy/cmake/precompiled.cpp)
  target_compile_features(${name} PRIVATE cxx_std_20)
  target_link_libraries(${name} PRIVATE fmt::fmt)
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR}/deploy/cmake)
  carillon_warnings(${name})
  set(headers <precompiled.hpp>)  # by its name alone, so that two clones have the same
  if(kind MATCHES "pic|loops")
    set_target_properties(${name} PROPERTIES POSITION_INDEPENDENT_CODE ON)
    target_compile_options(${name} PRIVATE $<$<STREQUAL:${kind},loops>:-fno-math-errno>)
  elseif(kind STREQUAL "test")
    find_package(GTest REQUIRED)
    target_link_libraries(${name} PRIVATE GTest::gtest)
    list(APPEND headers <gtest/gtest.h>)
  endif()
  target_precompile_headers(${name} PRIVATE ${headers})
endfunction()

function(carillon_use_precompiled target kind)
  get_target_property(is_pic ${target} POSITION_INDEPENDENT_CODE)
  get_target_property(type ${target} TYPE)
  get_target_property(standard ${target} CXX_STANDARD)
  get_target_property(options ${target} COMPILE_OPTIONS)
  get_target_property(is_disabled ${target} DISABLE_PRECOMPILE_HEADERS)
  if((standard AND NOT standard EQUAL 20) OR (type STREQUAL "EXECUTABLE" AND is_pic) OR is_disabled)
    return()  # other macros: of C++17, -fPIE, -pthread
  elseif("-fno-math-errno" IN_LIST options)
    set(kind loops)
  elseif(is_pic OR type STREQUAL "SHARED_LIBRARY")
    set(kind pic)
  endif()
  carillon_precompiled(${kind})
  get_target_property(sources ${target} SOURCES)
  get_target_property(folder ${target} SOURCE_DIR)
  foreach(source ${sources})  # loops with vector instructions of their own
    cmake_path(ABSOLUTE_PATH source BASE_DIRECTORY ${folder})
    get_source_file_property(options ${source} TARGET_DIRECTORY ${target} COMPILE_OPTIONS)
    get_source_file_property(flags ${source} TARGET_DIRECTORY ${target} COMPILE_FLAGS)
    if("${options} ${flags}" MATCHES "-m[a-z]|math-errno")
      set_source_files_properties(${source} TARGET_DIRECTORY ${target} PROPERTIES SKIP_PRECOMPILE_HEADERS ON)
    endif()
  endforeach()
  target_compile_definitions(${target} PRIVATE $<TARGET_PROPERTY:fmt::fmt,INTERFACE_COMPILE_DEFINITIONS>)
  target_precompile_headers(${target} REUSE_FROM carillon_precompiled_${kind})
endfunction()

# How the sources of a target are compiled. Done at the end of the configuration, when all properties are known.
function(carillon_compile target kind)
  set(calls)
  if(CARILLON_UNITY)
    string(APPEND calls "carillon_unite(${target})\n")
  endif()
  if(CARILLON_PRECOMPILE)
    string(APPEND calls "carillon_use_precompiled(${target} ${kind})\n")
  endif()
  if(calls)
    cmake_language(EVAL CODE "
      function(carillon_compile_${target})
        ${calls}
      endfunction()
      cmake_language(DEFER DIRECTORY [[${PROJECT_SOURCE_DIR}]] CALL carillon_compile_${target})")
  endif()
endfunction()

# ---- libraries, programs, tests ----

# carillon_library(NAME SOURCES ... PUBLIC libs... PRIVATE libs...): target carillon_NAME, alias carillon::NAME.
# Headers are included by their path from the root of the project: "runtime/bank/bank.hpp".
function(carillon_library name)
  cmake_parse_arguments(arg "" "" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
  add_library(carillon_${name} STATIC ${arg_SOURCES})
  add_library(carillon::${name} ALIAS carillon_${name})
  target_include_directories(carillon_${name} PUBLIC
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/carillon>)
  target_compile_features(carillon_${name} PUBLIC cxx_std_20)
  target_link_libraries(carillon_${name} PUBLIC ${arg_PUBLIC} PRIVATE ${arg_PRIVATE})
  carillon_warnings(carillon_${name})
  carillon_compile(carillon_${name} plain)
endfunction()

# carillon_program(carillon-NAME SOURCES ... LINK libs...)
function(carillon_program name)
  cmake_parse_arguments(arg "" "" "SOURCES;LINK" ${ARGN})
  add_executable(${name} ${arg_SOURCES})
  target_link_libraries(${name} PRIVATE ${arg_LINK})
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR})
  carillon_warnings(${name})
  carillon_compile(${name} plain)
  install(TARGETS ${name} RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
endfunction()

# carillon_helper(TARGET NAME file SOURCES ... LINK libs...): a program that only programs of Carillon start, in libexec/carillon.
function(carillon_helper target)
  cmake_parse_arguments(arg "" "NAME" "SOURCES;LINK" ${ARGN})
  add_executable(${target} ${arg_SOURCES})
  target_link_libraries(${target} PRIVATE ${arg_LINK})
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR})
  carillon_warnings(${target})
  carillon_compile(${target} plain)
  set_target_properties(${target} PROPERTIES OUTPUT_NAME ${arg_NAME} RUNTIME_OUTPUT_DIRECTORY ${CARILLON_HELPER_DIR})
  install(TARGETS ${target} RUNTIME DESTINATION ${CMAKE_INSTALL_LIBEXECDIR}/carillon)
endfunction()

# A TIMEOUT is what a test may take alone on an idle core. Its limit is three times that: deploy/test runs two tests a core, and a machine
# may be slower.
function(carillon_limit_time out seconds)
  math(EXPR limit "3 * ${seconds}")
  set(${out} ${limit} PARENT_SCOPE)
endfunction()

# Slots of CTest, PROCESSORS, are half cores: deploy/test runs two tests a core, since many wait for much of their time. A rank that waits
# polls, and keeps from its core the rank that it waits for: four pairs of ranks on two cores take ten times as long as one after the
# other. So a rank takes a whole core.
function(carillon_take_cores test cores)
  math(EXPR slots "2 * ${cores}")
  set_tests_properties(${test} PROPERTIES PROCESSORS ${slots})
endfunction()

function(carillon_warnings target)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic -Wno-unknown-pragmas)
endfunction()

# The GoogleTest programs: test_NAME, with a main of ours that chooses the cases of some sources (tests/support/choose_sources.hpp).
function(carillon_test_program name)
  if(TARGET test_${name})
    return()
  endif()
  if(name MATCHES "ranks$")
    add_executable(test_${name} ${PROJECT_SOURCE_DIR}/tests/support/mpi_main.cpp)
    target_link_libraries(test_${name} PRIVATE carillon::petsc)
  else()
    add_executable(test_${name} ${PROJECT_SOURCE_DIR}/tests/support/main.cpp)
  endif()
  if(name STREQUAL "heap")
    target_sources(test_${name} PRIVATE ${PROJECT_SOURCE_DIR}/tests/support/heap_counter.cpp)
  endif()
  target_link_libraries(test_${name} PRIVATE GTest::gtest carillon_test_paths)
  target_include_directories(test_${name} PRIVATE ${PROJECT_SOURCE_DIR})
  carillon_warnings(test_${name})
endfunction()

# carillon_test(NAME SOURCES ... LINK libs... [RANKS 1 2 3] [PROGRAM p] [LABELS ...] [TIMEOUT s] [PART part] [SLOW Suite.Case ...])
# GoogleTest cases of one module, in test_PROGRAM with those of others (CARILLON_TEST_PROGRAM, the program of the folder, where not given), and
# one CTest test: NAME, or with RANKS those of test_ranks under mpirun, NAME.npN. One process for all cases: to start one that loads PETSc
# takes longer than most cases. SEPARATE: names in the sources' unnamed namespaces are equal, so each is compiled alone. A case alone:
# GTEST_FILTER=Suite.Case ctest -R '^NAME$'.
# SLOW: these cases are a test of their own, NAME.slow, in part hard.
# Labels: CARILLON_TEST_KIND, the kind of the folder; the part (docs/howto/test.md), basic where not given, where ranks are other than 2
# `ranks`. Every test has a TIMEOUT (carillon_limit_time), which is its COST, too: CTest takes the longest first.
function(carillon_test name)
  cmake_parse_arguments(arg "SEPARATE" "TIMEOUT;PROGRAM;PART" "SOURCES;LINK;RANKS;LABELS;SLOW" ${ARGN})
  if(NOT arg_TIMEOUT)
    set(arg_TIMEOUT 120)
  endif()
  if(NOT arg_PART)
    set(arg_PART basic)
  endif()
  if(arg_RANKS)
    set(arg_PROGRAM ranks)
    list(APPEND arg_LINK carillon::petsc)
  elseif(NOT arg_PROGRAM)
    set(arg_PROGRAM ${CARILLON_TEST_PROGRAM})
  endif()
  carillon_limit_time(limit ${arg_TIMEOUT})
  string(REPLACE "." "_" objects tests_${name})
  add_library(${objects} OBJECT ${arg_SOURCES})
  target_include_directories(${objects} PUBLIC ${PROJECT_SOURCE_DIR})
  target_link_libraries(${objects} PUBLIC ${arg_LINK} carillon_test_paths GTest::gtest)
  carillon_warnings(${objects})
  if(arg_SEPARATE)
    set_source_files_properties(${arg_SOURCES} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
  endif()
  carillon_compile(${objects} test)
  carillon_test_program(${arg_PROGRAM})
  target_link_libraries(test_${arg_PROGRAM} PRIVATE ${objects})
  list(TRANSFORM arg_SOURCES PREPEND ${CMAKE_CURRENT_SOURCE_DIR}/ OUTPUT_VARIABLE chosen)
  list(FILTER chosen INCLUDE REGEX "_test[.]cpp$")
  list(TRANSFORM chosen REPLACE "^${PROJECT_SOURCE_DIR}/" "")
  list(JOIN chosen "," chosen)
  set(labels ${CARILLON_TEST_KIND} ${arg_LABELS})
  set(cases --sources=${chosen})
  if(arg_SLOW)
    list(JOIN arg_SLOW "," slow)
    set(mpi)
    if(arg_RANKS)
      carillon_mpi_command(mpi 1)
    endif()
    add_test(NAME ${name}.slow COMMAND ${mpi} $<TARGET_FILE:test_${arg_PROGRAM}> ${cases} --only=${slow} --gtest_brief=1)
    set_tests_properties(${name}.slow PROPERTIES TIMEOUT ${limit} COST ${arg_TIMEOUT} LABELS "${labels};part.hard" ENVIRONMENT "${CARILLON_MPI_ENVIRONMENT}")
    list(APPEND cases --without=${slow})
  endif()
  if(arg_RANKS)
    foreach(ranks ${arg_RANKS})
      set(part ${arg_PART})
      if(NOT ranks EQUAL 2 AND NOT arg_RANKS STREQUAL "1")
        set(part ranks)
      endif()
      carillon_mpi_command(mpi ${ranks})
      add_test(NAME ${name}.np${ranks} COMMAND ${mpi} $<TARGET_FILE:test_ranks> ${cases} --gtest_brief=1)
      set_tests_properties(${name}.np${ranks} PROPERTIES TIMEOUT ${limit} COST ${arg_TIMEOUT} LABELS "mpi;${labels};part.${part}"
        ENVIRONMENT "${CARILLON_MPI_ENVIRONMENT}")
      carillon_take_cores(${name}.np${ranks} ${ranks})
    endforeach()
  else()
    add_test(NAME ${name} COMMAND test_${arg_PROGRAM} ${cases} --gtest_brief=1)
    set_tests_properties(${name} PROPERTIES TIMEOUT ${limit} COST ${arg_TIMEOUT} LABELS "${labels};part.${arg_PART}")
    if("mpi" IN_LIST labels)  # it starts programs
      carillon_take_cores(${name} 1)
    endif()
  endif()
endfunction()

# The environment and the command line under which tests start MPI programs: one thread a rank, and for Open MPI, which alone reads OMPI_*:
# more ranks than cores allowed, root allowed, no binding to cores. MPIEXEC_* are those of CMake's FindMPI; what another MPI needs goes
# into MPIEXEC_PREFLAGS.
set(CARILLON_MPI_ENVIRONMENT OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 HWLOC_COMPONENTS=-gl;OMPI_MCA_pml=ob1
  OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 OMPI_MCA_rmaps_base_oversubscribe=1
  OMPI_MCA_hwloc_base_binding_policy=none OMPI_MCA_mpi_yield_when_idle=1)
function(carillon_mpi_command out ranks)
  set(${out} ${MPIEXEC_EXECUTABLE} ${MPIEXEC_NUMPROC_FLAG} ${ranks} ${MPIEXEC_PREFLAGS} PARENT_SCOPE)
endfunction()

# carillon_script_test(NAME COMMAND ... [LABELS ...] [TIMEOUT s] [CORES n] [PART part] [FIXTURES name...]): a test that is a script or a program run
# with arguments. FIXTURES: of tests/support/fixtures.py. PART: not given, that of the folder, CARILLON_TEST_PART. CORES: what
# it starts keeps so many busy; not given: half a core, with a label mpi, jobs or examples one, since most of what such a test starts has
# one rank.
function(carillon_script_test name)
  cmake_parse_arguments(arg "" "TIMEOUT;CORES;PART" "COMMAND;LABELS;FIXTURES" ${ARGN})
  if(NOT arg_TIMEOUT)
    set(arg_TIMEOUT 120)
  endif()
  if("long" IN_LIST arg_LABELS)
    set(arg_PART long)
  elseif(NOT arg_PART)
    set(arg_PART ${CARILLON_TEST_PART})
  endif()
  carillon_limit_time(limit ${arg_TIMEOUT})
  set(labels ${CARILLON_TEST_KIND} ${arg_LABELS} part.${arg_PART})
  add_test(NAME ${name} COMMAND ${arg_COMMAND})
  set_tests_properties(${name} PROPERTIES TIMEOUT ${limit} COST ${arg_TIMEOUT} LABELS "${labels}"
    ENVIRONMENT "${CARILLON_MPI_ENVIRONMENT};CARILLON_BIN_DIR=${CMAKE_BINARY_DIR}/bin;CARILLON_SOURCE_DIR=${PROJECT_SOURCE_DIR}")
  if(arg_FIXTURES)
    set_tests_properties(${name} PROPERTIES FIXTURES_REQUIRED "${arg_FIXTURES}")
  endif()
  if(NOT arg_CORES AND labels MATCHES "(^|;)(mpi|jobs|examples)(;|$)")
    set(arg_CORES 1)
  endif()
  if(arg_CORES)
    carillon_take_cores(${name} ${arg_CORES})
  endif()
endfunction()

# carillon_fuzz(NAME SOURCES ... LINK libs... CORPUS dirs... [DICTIONARY file]): a libFuzzer target (clang only, CARILLON_FUZZ=ON) and a short CTest
# run of it. A dictionary has the words of a format.
function(carillon_fuzz name)
  if(NOT CARILLON_FUZZ)
    return()
  endif()
  cmake_parse_arguments(arg "" "DICTIONARY" "SOURCES;LINK;CORPUS" ${ARGN})
  if(arg_DICTIONARY)
    set(dictionary -dict=${arg_DICTIONARY})
  endif()
  add_executable(fuzz_${name} ${arg_SOURCES})
  target_include_directories(fuzz_${name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_compile_options(fuzz_${name} PRIVATE -fsanitize=fuzzer)
  target_link_options(fuzz_${name} PRIVATE -fsanitize=fuzzer)
  target_link_libraries(fuzz_${name} PRIVATE ${arg_LINK})
  if(NOT TARGET fuzz_all)
    add_custom_target(fuzz_all)
  endif()
  add_dependencies(fuzz_all fuzz_${name})
  # New inputs go to a folder of the build; the kept corpus is only read.
  file(MAKE_DIRECTORY ${CMAKE_BINARY_DIR}/fuzz/${name})
  add_test(NAME fuzz.${name} COMMAND fuzz_${name} -max_total_time=15 -rss_limit_mb=3000 -timeout=20 -print_final_stats=1
    ${dictionary} -artifact_prefix=${CMAKE_BINARY_DIR}/fuzz/${name}- ${CMAKE_BINARY_DIR}/fuzz/${name} ${arg_CORPUS})
  set_tests_properties(fuzz.${name} PROPERTIES LABELS fuzz TIMEOUT 120)
endfunction()
