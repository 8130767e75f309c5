# How a Carillon library, program or test is declared.

include(GoogleTest)

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
endfunction()

# carillon_program(carillon-NAME SOURCES ... LINK libs...)
function(carillon_program name)
  cmake_parse_arguments(arg "" "" "SOURCES;LINK" ${ARGN})
  add_executable(${name} ${arg_SOURCES})
  target_link_libraries(${name} PRIVATE ${arg_LINK})
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR})
  carillon_warnings(${name})
  install(TARGETS ${name} RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
endfunction()

function(carillon_warnings target)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic -Wno-unknown-pragmas)
endfunction()

# carillon_test(NAME SOURCES ... LINK libs... [RANKS 1 2 3] [LABELS ...] [TIMEOUT s])
# GoogleTest binary. Without RANKS every test case is a CTest test NAME.Suite.Case; with RANKS the whole binary runs under mpirun as
# NAME.npN (its main is tests/support/mpi_main.cpp). Every test has a TIMEOUT, by which CTest also takes the longest first (COST).
function(carillon_test name)
  cmake_parse_arguments(arg "" "TIMEOUT" "SOURCES;LINK;RANKS;LABELS" ${ARGN})
  if(NOT arg_TIMEOUT)
    set(arg_TIMEOUT 120)
  endif()
  string(REPLACE "." "_" target test_${name})
  add_executable(${target} ${arg_SOURCES})
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR})
  target_compile_definitions(${target} PRIVATE CARILLON_SOURCE_DIR="${PROJECT_SOURCE_DIR}" CARILLON_BIN_DIR="${CMAKE_BINARY_DIR}/bin")
  carillon_warnings(${target})
  if(arg_RANKS)
    target_sources(${target} PRIVATE ${PROJECT_SOURCE_DIR}/tests/support/mpi_main.cpp)
    target_link_libraries(${target} PRIVATE ${arg_LINK} carillon::petsc GTest::gtest)
    foreach(ranks ${arg_RANKS})
      carillon_mpi_command(command ${ranks})
      add_test(NAME ${name}.np${ranks} COMMAND ${command} $<TARGET_FILE:${target}>)
      set_tests_properties(${name}.np${ranks} PROPERTIES PROCESSORS ${ranks} TIMEOUT ${arg_TIMEOUT} COST ${arg_TIMEOUT} LABELS "mpi;${arg_LABELS}"
        ENVIRONMENT "${CARILLON_MPI_ENVIRONMENT}")
    endforeach()
  else()
    target_link_libraries(${target} PRIVATE ${arg_LINK} GTest::gtest_main)
    gtest_discover_tests(${target} TEST_PREFIX ${name}. DISCOVERY_TIMEOUT 60
      PROPERTIES TIMEOUT ${arg_TIMEOUT} COST ${arg_TIMEOUT} LABELS "${arg_LABELS}")
  endif()
endfunction()

# The environment and the command line under which tests start MPI programs: one thread a rank, more ranks than cores allowed, root allowed.
set(CARILLON_MPI_ENVIRONMENT
  "OMPI_ALLOW_RUN_AS_ROOT=1;OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1;OPENBLAS_NUM_THREADS=1;OMP_NUM_THREADS=1;OMPI_MCA_rmaps_base_oversubscribe=1;OMPI_MCA_hwloc_base_binding_policy=none;OMPI_MCA_mpi_yield_when_idle=1;HWLOC_COMPONENTS=-gl")
function(carillon_mpi_command out ranks)
  set(${out} mpirun -np ${ranks} --oversubscribe --bind-to none PARENT_SCOPE)
endfunction()

# carillon_script_test(NAME COMMAND ... [LABELS ...] [TIMEOUT s]): a test that is a script or a program run with arguments.
function(carillon_script_test name)
  cmake_parse_arguments(arg "" "TIMEOUT" "COMMAND;LABELS" ${ARGN})
  if(NOT arg_TIMEOUT)
    set(arg_TIMEOUT 120)
  endif()
  add_test(NAME ${name} COMMAND ${arg_COMMAND})
  set_tests_properties(${name} PROPERTIES TIMEOUT ${arg_TIMEOUT} COST ${arg_TIMEOUT} LABELS "${arg_LABELS}"
    ENVIRONMENT "${CARILLON_MPI_ENVIRONMENT};CARILLON_BIN_DIR=${CMAKE_BINARY_DIR}/bin;CARILLON_SOURCE_DIR=${PROJECT_SOURCE_DIR}")
endfunction()

# carillon_fuzz(NAME SOURCES ... LINK libs... CORPUS dir): a libFuzzer target (clang only, CARILLON_FUZZ=ON) and a short CTest run of it.
function(carillon_fuzz name)
  if(NOT CARILLON_FUZZ)
    return()
  endif()
  cmake_parse_arguments(arg "" "CORPUS" "SOURCES;LINK" ${ARGN})
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
    -artifact_prefix=${CMAKE_BINARY_DIR}/fuzz/${name}- ${CMAKE_BINARY_DIR}/fuzz/${name} ${arg_CORPUS})
  set_tests_properties(fuzz.${name} PROPERTIES LABELS fuzz TIMEOUT 120)
endfunction()
