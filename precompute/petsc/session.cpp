// Source: PETSc users manual 3.18, "Error handling", "Runtime options"; MPI 3.1.
#include "precompute/petsc/session.hpp"

#include <fmt/core.h>
#include <malloc.h>
#include <slepcsys.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <vector>

#include "runtime/base/failure.hpp"

namespace carillon::petsc {
namespace {

// First message since the last check(): PETSc reports the origin first, then every caller.
thread_local std::string recorded_error;

PetscErrorCode record_error(MPI_Comm, int line, const char* function, const char* file, PetscErrorCode code, PetscErrorType type,
                            const char* message, void*) {
  if (type == PETSC_ERROR_INITIAL || recorded_error.empty()) {
    const char* general = nullptr;
    (void)PetscErrorMessage(code, &general, nullptr);
    recorded_error = fmt::format("{}: {} ({}, {}:{})", general != nullptr ? general : "PETSc error", message != nullptr ? message : "",
                                 function != nullptr ? function : "?", file != nullptr ? file : "?", line);
  }
  return code;
}

bool is_system_error(PetscErrorCode code) {
  return code == PETSC_ERR_SYS || code == PETSC_ERR_FILE_OPEN || code == PETSC_ERR_FILE_READ || code == PETSC_ERR_FILE_WRITE ||
         code == PETSC_ERR_FILE_UNEXPECTED;
}

// SuperLU_DIST, which PETSc loads, forbids malloc to map large blocks and to return memory: freed memory stays with the process, and calloc
// clears it. Restore mapping of large blocks; smaller ones, which are allocated in every step, stay in the heap.
void let_malloc_give_back() {
  constexpr int kMaxMaps = 65536;  // default of glibc
  constexpr int kLarge = 4 << 20;
  constexpr int kKept = 64 << 20;
  (void)mallopt(M_MMAP_MAX, kMaxMaps);
  (void)mallopt(M_MMAP_THRESHOLD, kLarge);
  (void)mallopt(M_TRIM_THRESHOLD, kKept);
}

// PETSc clears allocated memory by writing zeros. The system provides large blocks already cleared, page by page at first access, so unused
// memory takes neither time nor memory.
PetscErrorCode allocate(size_t bytes, PetscBool clear, int, const char[], const char[], void** result) {
  *result = nullptr;
  if (bytes == 0) return 0;
  *result = clear == PETSC_TRUE ? std::calloc(bytes, 1) : std::malloc(bytes);
  if (*result == nullptr) SETERRQ(PETSC_COMM_SELF, PETSC_ERR_MEM, "%.0f bytes", static_cast<double>(bytes));
  return 0;
}

PetscErrorCode release(void* memory, int, const char[], const char[]) {
  std::free(memory);
  return 0;
}

PetscErrorCode reallocate(size_t bytes, int, const char[], const char[], void** memory) {
  void* larger = std::realloc(*memory, std::max<size_t>(bytes, 1));
  if (larger == nullptr) SETERRQ(PETSC_COMM_SELF, PETSC_ERR_MEM, "%.0f bytes", static_cast<double>(bytes));
  *memory = larger;
  return 0;
}

// Options for PETSc's own allocators exclude ours.
bool asks_for_allocator(const std::vector<std::string>& options) {
  return std::any_of(options.begin(), options.end(), [](const std::string& option) { return option.rfind("-malloc", 0) == 0; });
}

}  // namespace

Session::Session(int& argc, char**& argv, const std::vector<std::string>& petsc_options) {
  int is_initialized = 0;
  MPI_Initialized(&is_initialized);
  if (is_initialized == 0) {
    if (MPI_Init(&argc, &argv) != MPI_SUCCESS) throw SystemError("MPI does not start. Start the program with mpirun, or directly.");
    started_mpi_ = true;
  }
  // PETSc reads these even if its option files are skipped.
  unsetenv("PETSC_OPTIONS");
  unsetenv("PETSC_OPTIONS_YAML");
  // PETSc keeps the pointers while it runs.
  static std::vector<std::string> own;
  static std::vector<char*> own_argv;
  own = {"carillon", "-skip_petscrc", "-no_signal_handler"};
  own.insert(own.end(), petsc_options.begin(), petsc_options.end());
  own_argv.clear();
  for (std::string& word : own) own_argv.push_back(word.data());
  own_argv.push_back(nullptr);
  int own_argc = static_cast<int>(own.size());
  char** own_args = own_argv.data();
  let_malloc_give_back();
  if (!asks_for_allocator(petsc_options)) (void)PetscMallocSet(allocate, release, reallocate);
  if (SlepcInitialize(&own_argc, &own_args, nullptr, nullptr) != 0) throw SystemError("PETSc and SLEPc do not start.");
  (void)PetscPushErrorHandler(record_error, nullptr);
  MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
  MPI_Comm_size(MPI_COMM_WORLD, &size_);
}

Session::~Session() {
  (void)PetscPopErrorHandler();
  (void)SlepcFinalize();
  int is_finalized = 0;
  MPI_Finalized(&is_finalized);
  if (started_mpi_ && is_finalized == 0) MPI_Finalize();
}

std::vector<std::string> find_unused_options() {
  std::vector<std::string> unused;
  PetscInt count = 0;
  char** names = nullptr;
  char** values = nullptr;
  check(PetscOptionsLeftGet(nullptr, &count, &names, &values));
  for (PetscInt i = 0; i < count; ++i) {
    const std::string name = names[i];
    const bool is_read_later = name == "options_left" || name == "memory_view" || name == "malloc_dump";
    if (name != "skip_petscrc" && name != "no_signal_handler" && !is_read_later) unused.push_back("-" + name);
  }
  check(PetscOptionsLeftRestore(nullptr, &count, &names, &values));
  return unused;
}

void check(PetscErrorCode code) {
  if (code == 0) return;
  std::string text = recorded_error.empty() ? fmt::format("PETSc error {}", static_cast<int>(code)) : recorded_error;
  recorded_error.clear();
  if (code == PETSC_ERR_MEM) throw MemoryError(text);
  if (is_system_error(code)) throw SystemError(text);
  throw SolveError(text);
}

comm::Communicator get_communicator(PetscObject object) {
  MPI_Comm comm = MPI_COMM_NULL;
  check(PetscObjectGetComm(object, &comm));
  return comm;
}

PetscInt to_petsc_int(std::int64_t value) {
  if (value < std::numeric_limits<PetscInt>::min() || value > std::numeric_limits<PetscInt>::max()) {
    throw SystemError(fmt::format("{} does not fit PETSc's index type of this build. Take a coarser mesh.", value));
  }
  return static_cast<PetscInt>(value);
}

void give_back_pages(void* begin, void* end) {
  const auto page = static_cast<std::uintptr_t>(sysconf(_SC_PAGESIZE));
  const std::uintptr_t first = (reinterpret_cast<std::uintptr_t>(begin) + page - 1) / page * page;
  const std::uintptr_t last = reinterpret_cast<std::uintptr_t>(end) / page * page;
  if (first < last) (void)madvise(reinterpret_cast<void*>(first), last - first, MADV_DONTNEED);
}

std::string petsc_version() { return fmt::format("PETSc {}.{}.{}", PETSC_VERSION_MAJOR, PETSC_VERSION_MINOR, PETSC_VERSION_SUBMINOR); }

std::string slepc_version() { return fmt::format("SLEPc {}.{}.{}", SLEPC_VERSION_MAJOR, SLEPC_VERSION_MINOR, SLEPC_VERSION_SUBMINOR); }

std::string mpi_version() {
  std::array<char, MPI_MAX_LIBRARY_VERSION_STRING> text{};
  int length = 0;
  MPI_Get_library_version(text.data(), &length);
  const std::string all(text.data(), static_cast<std::size_t>(length));
  return all.substr(0, all.find(','));
}

}  // namespace carillon::petsc
