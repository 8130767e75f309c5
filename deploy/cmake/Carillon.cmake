# How a Carillon library, program or test is declared.

include(GoogleTest)

# ---- precompiled standard headers ----

# Without optimisation gcc 12 reads intrinsics behind a precompiled header as if it optimised, and refuses Eigen's prefetches.
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND NOT CMAKE_BUILD_TYPE STREQUAL "Debug")
  set(precompiles ON)
endif()
option(CARILLON_PRECOMPILE "Precompile the standard headers (saves a fifth to a half of a source's compilation; gcc only)" ${precompiles})
if(CARILLON_PRECOMPILE)
  add_compile_options($<$<COMPILE_LANGUAGE:CXX>:-fpch-preprocess>)  # or ccache would not cache
endif()

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
  carillon_warnings(${name})
  set(headers ${PROJECT_SOURCE_DIR}/deploy/cmake/precompiled.hpp)
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

# At the end of the configuration, when all properties are known.
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

function(carillon_precompile target kind)
  if(CARILLON_PRECOMPILE)
    cmake_language(EVAL CODE "cmake_language(DEFER DIRECTORY [[${PROJECT_SOURCE_DIR}]] CALL carillon_use_precompiled ${target} ${kind})")
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
  carillon_precompile(carillon_${name} plain)
endfunction()

# carillon_program(carillon-NAME SOURCES ... LINK libs...)
function(carillon_program name)
  cmake_parse_arguments(arg "" "" "SOURCES;LINK" ${ARGN})
  add_executable(${name} ${arg_SOURCES})
  target_link_libraries(${name} PRIVATE ${arg_LINK})
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR})
  carillon_warnings(${name})
  carillon_precompile(${name} plain)
  install(TARGETS ${name} RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
endfunction()

# carillon_helper(TARGET NAME file SOURCES ... LINK libs...): a program that only programs of Carillon start, in libexec/carillon.
function(carillon_helper target)
  cmake_parse_arguments(arg "" "NAME" "SOURCES;LINK" ${ARGN})
  add_executable(${target} ${arg_SOURCES})
  target_link_libraries(${target} PRIVATE ${arg_LINK})
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR})
  carillon_warnings(${target})
  carillon_precompile(${target} plain)
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

# carillon_test(NAME SOURCES ... LINK libs... [RANKS 1 2 3] [LABELS ...] [TIMEOUT s])
# GoogleTest binary, one CTest test: NAME, or with RANKS under mpirun NAME.npN (its main is tests/support/mpi_main.cpp). One process for all
# cases: to start one that loads PETSc takes longer than most cases. A case alone: GTEST_FILTER=Suite.Case ctest -R '^NAME$'.
# The sources of a test are compiled together, six at a time, which takes two thirds of the time: their unnamed namespaces are one. SEPARATE:
# each alone. CARILLON_TEST_KIND, the kind of the folder, is one more label. Every test has a TIMEOUT (carillon_limit_time), which is its COST, too: CTest takes the longest first.
function(carillon_test name)
  cmake_parse_arguments(arg "SEPARATE" "TIMEOUT" "SOURCES;LINK;RANKS;LABELS" ${ARGN})
  if(NOT arg_TIMEOUT)
    set(arg_TIMEOUT 120)
  endif()
  carillon_limit_time(limit ${arg_TIMEOUT})
  string(REPLACE "." "_" target test_${name})
  add_executable(${target} ${arg_SOURCES})
  if(NOT arg_SEPARATE)
    set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 6)
  endif()
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR})
  target_compile_definitions(${target} PRIVATE CARILLON_SOURCE_DIR="${PROJECT_SOURCE_DIR}" CARILLON_BIN_DIR="${CMAKE_BINARY_DIR}/bin")
  carillon_warnings(${target})
  carillon_precompile(${target} test)
  set(labels ${CARILLON_TEST_KIND} ${arg_LABELS})
  if(arg_RANKS)
    target_sources(${target} PRIVATE ${PROJECT_SOURCE_DIR}/tests/support/mpi_main.cpp)
    target_link_libraries(${target} PRIVATE ${arg_LINK} carillon::petsc GTest::gtest)
    foreach(ranks ${arg_RANKS})
      carillon_mpi_command(command ${ranks})
      add_test(NAME ${name}.np${ranks} COMMAND ${command} $<TARGET_FILE:${target}>)
      set_tests_properties(${name}.np${ranks} PROPERTIES TIMEOUT ${limit} COST ${arg_TIMEOUT} LABELS "mpi;${labels}"
        ENVIRONMENT "${CARILLON_MPI_ENVIRONMENT}")
      carillon_take_cores(${name}.np${ranks} ${ranks})
    endforeach()
  else()
    target_link_libraries(${target} PRIVATE ${arg_LINK} GTest::gtest_main)
    add_test(NAME ${name} COMMAND ${target} --gtest_brief=1)
    set_tests_properties(${name} PROPERTIES TIMEOUT ${limit} COST ${arg_TIMEOUT} LABELS "${labels}")
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

# carillon_script_test(NAME COMMAND ... [LABELS ...] [TIMEOUT s] [CORES n]): a test that is a script or a program run with arguments. CORES: what
# it starts keeps so many busy; not given: half a core, with a label mpi, jobs or examples one, since most of what such a test starts has
# one rank.
function(carillon_script_test name)
  cmake_parse_arguments(arg "" "TIMEOUT;CORES" "COMMAND;LABELS" ${ARGN})
  if(NOT arg_TIMEOUT)
    set(arg_TIMEOUT 120)
  endif()
  carillon_limit_time(limit ${arg_TIMEOUT})
  set(labels ${CARILLON_TEST_KIND} ${arg_LABELS})
  add_test(NAME ${name} COMMAND ${arg_COMMAND})
  set_tests_properties(${name} PROPERTIES TIMEOUT ${limit} COST ${arg_TIMEOUT} LABELS "${labels}"
    ENVIRONMENT "${CARILLON_MPI_ENVIRONMENT};CARILLON_BIN_DIR=${CMAKE_BINARY_DIR}/bin;CARILLON_SOURCE_DIR=${PROJECT_SOURCE_DIR}")
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
