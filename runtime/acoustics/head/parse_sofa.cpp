// Method:     the child process calls libmysofa, checks all sizes and writes the numbers, or an error text, to a pipe. The parent bounds
//             and counts what it reads from the pipe and does not interpret it.
// Source:     AES69-2015 (SOFA).
#include "runtime/acoustics/head/parse_sofa.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <mysofa.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <initializer_list>
#include <span>
#include <string_view>

#include "runtime/acoustics/head/head.hpp"
#include "runtime/acoustics/head/sofa.hpp"
#include "runtime/base/descriptor.hpp"
#include "runtime/base/error.hpp"

namespace carillon::head {
namespace {

constexpr std::uint64_t kMaxMemory = std::uint64_t{4} << 30U;  // bytes that the child may allocate
constexpr std::size_t kBytesPerS = 2000000;                    // a tenth of the speed of libmysofa with compressed files
constexpr std::size_t kMaxWords = 1000;                        // bytes of an error text

std::string_view explain(int error) {
  switch (error) {
    case MYSOFA_UNSUPPORTED_FORMAT:
      return "it uses HDF5 features that libmysofa cannot read; write it again with a SOFA library";
    case MYSOFA_INVALID_ATTRIBUTES:
      return "it is not of the convention SimpleFreeFieldHRIR with responses in time (DataType FIR)";
    case MYSOFA_INVALID_DIMENSIONS:
    case MYSOFA_INVALID_DIMENSION_LIST:
      return "its dimensions are not those of SimpleFreeFieldHRIR: two receivers and one emitter";
    case MYSOFA_INVALID_COORDINATE_TYPE:
    case MYSOFA_ONLY_SOURCES_WITH_MC_SUPPORTED:
      return "its coordinates are neither spherical nor cartesian, one for each measurement";
    case MYSOFA_ONLY_THE_SAME_SAMPLING_RATE_SUPPORTED:
      return "it has more than one sample rate";
    case MYSOFA_NO_MEMORY:
      return "not enough memory for it";
    case MYSOFA_INVALID_FORMAT:
    case MYSOFA_READ_ERROR:
      return "not a SOFA file, or damaged, or an array larger than the limit of libmysofa (256 MB)";
    default:
      return "libmysofa cannot read it";
  }
}

[[noreturn]] void refuse(const std::string& name, std::string_view why) { throw InputError(fmt::format("{}: {}", name, why)); }

/// Attribute of an array; empty if missing.
std::string_view find_attribute(const MYSOFA_ARRAY& array, std::string_view name) {
  for (const MYSOFA_ATTRIBUTE* at = array.attributes; at != nullptr; at = at->next)
    if (at->name != nullptr && at->value != nullptr && name == at->name) return at->value;
  return {};
}

std::span<const float> get_values(const MYSOFA_ARRAY& array) {
  return array.values == nullptr ? std::span<const float>() : std::span<const float>(array.values, array.elements);
}

bool is_finite(std::span<const float> values) {
  return std::all_of(values.begin(), values.end(), [](float value) { return std::isfinite(value); });
}

/// Throws InputError unless all array sizes match the dimensions.
void check_sizes(const MYSOFA_HRTF& hrtf, const std::string& name) {
  const std::size_t M = hrtf.M, R = hrtf.R, N = hrtf.N;
  if (hrtf.C != 3 || hrtf.I != 1 || R != 2 || M == 0 || N == 0) refuse(name, explain(MYSOFA_INVALID_DIMENSIONS));
  if (M > kMaxDirections) refuse(name, fmt::format("it has {} directions; at most {} are supported", M, kMaxDirections));
  if (N > kMaxTaps) refuse(name, fmt::format("its responses have {} taps; at most {} are supported", N, kMaxTaps));
  if (M * R * N > kMaxSamples)
    refuse(name, fmt::format("it has {} samples, at most {} are supported; shorten its responses", M * R * N, kMaxSamples));
  const auto is_of = [](const MYSOFA_ARRAY& array, std::initializer_list<std::size_t> sizes) {
    return std::find(sizes.begin(), sizes.end(), get_values(array).size()) != sizes.end();
  };
  if (!is_of(hrtf.DataIR, {M * R * N}) || !is_of(hrtf.SourcePosition, {3 * M}) || !is_of(hrtf.DataSamplingRate, {1}) ||
      !is_of(hrtf.DataDelay, {0, R, M * R}) || !is_of(hrtf.ReceiverPosition, {3 * R, 3 * R * M}) ||
      !is_of(hrtf.EmitterPosition, {3, 3 * M}) || !is_of(hrtf.ListenerView, {0, 3, 3 * M}))
    refuse(name, "an array is missing, or its size does not match its dimensions");
}

/// Header of the data in the pipe.
struct Header {
  double sample_rate_hz = 0.0;
  std::uint64_t measurements = 0, taps = 0, delays = 0;
  std::uint64_t is_cartesian = 0;
  std::uint64_t words = 0;  // bytes of the error text; 0: success
};

bool write_all(int pipe, const void* bytes, std::size_t count) noexcept {
  return base::write_all(pipe, {static_cast<const char*>(bytes), count}) == 0;
}

bool read_all(int pipe, void* bytes, std::size_t count) noexcept {
  for (char* at = static_cast<char*>(bytes); count > 0;) {
    const ssize_t got = ::read(pipe, at, count);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return false;
    at += got;
    count -= static_cast<std::size_t>(got);
  }
  return true;
}

bool write_values(int pipe, const MYSOFA_ARRAY& array) noexcept {
  const std::span<const float> values = get_values(array);
  return write_all(pipe, values.data(), values.size_bytes());
}

/// Runs in the child.
void parse_into(int pipe, const std::string& bytes, const std::string& name) {
  int error = MYSOFA_OK;
  MYSOFA_HRTF* const hrtf = mysofa_load_data(bytes.data(), bytes.size(), &error);  // freed by the end of the process
  if (hrtf == nullptr || error != MYSOFA_OK) refuse(name, explain(error));
  check_sizes(*hrtf, name);
  if (const int wrong = mysofa_check(hrtf); wrong != MYSOFA_OK) refuse(name, explain(wrong));
  const std::string_view type = find_attribute(hrtf->SourcePosition, "Type");
  if (type != "spherical" && type != "cartesian") refuse(name, explain(MYSOFA_INVALID_COORDINATE_TYPE));
  const Header header{.sample_rate_hz = static_cast<double>(hrtf->DataSamplingRate.values[0]),
                      .measurements = hrtf->M,
                      .taps = hrtf->N,
                      .delays = get_values(hrtf->DataDelay).size(),
                      .is_cartesian = type == "cartesian" ? 1U : 0U};
  if (write_all(pipe, &header, sizeof header) && write_values(pipe, hrtf->SourcePosition) && write_values(pipe, hrtf->DataIR))
    write_values(pipe, hrtf->DataDelay);
}

using Resource = decltype(RLIMIT_CPU);
void limit(Resource resource, std::uint64_t value) noexcept {
  rlimit now{};
  if (::getrlimit(resource, &now) != 0) return;
  now.rlim_cur = std::min<rlim_t>(value, now.rlim_max);
  ::setrlimit(resource, &now);
}

/// Address space of this process [bytes]; 0 if unknown.
std::uint64_t find_memory() noexcept {
  std::uint64_t pages = 0;
  if (std::FILE* const file = std::fopen("/proc/self/statm", "r")) {
    unsigned long long count = 0;
    if (std::fscanf(file, "%llu", &count) == 1) pages = count;
    std::fclose(file);
  }
  return pages * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
}

[[noreturn]] void run_child(int pipe, const std::string& bytes, const std::string& name) noexcept {
  for (const int signal : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGXCPU, SIGPIPE}) ::signal(signal, SIG_DFL);
  if (const int nowhere = ::open("/dev/null", O_WRONLY); nowhere >= 0)
    ::dup2(nowhere, STDERR_FILENO);  // discards messages of the C library
  limit(RLIMIT_CORE, 0);
  limit(RLIMIT_CPU, 2 + bytes.size() / kBytesPerS);
  if (const std::uint64_t memory = find_memory(); memory > 0) limit(RLIMIT_AS, memory + kMaxMemory);
  try {
    parse_into(pipe, bytes, name);
  } catch (const std::exception& error) {
    const std::string_view words = std::string_view(error.what()).substr(0, kMaxWords);
    const Header header{.words = words.size()};
    if (write_all(pipe, &header, sizeof header)) write_all(pipe, words.data(), words.size());
  }
  ::_exit(0);
}

/// Reads the result of the child. Throws InputError.
SofaFile receive(int pipe, const std::string& name) {
  constexpr std::string_view kDamaged = "it is damaged: libmysofa fails on it";
  Header header;
  if (!read_all(pipe, &header, sizeof header)) refuse(name, kDamaged);
  if (header.words > 0) {
    std::string words(std::min<std::uint64_t>(header.words, kMaxWords), ' ');
    if (!read_all(pipe, words.data(), words.size())) refuse(name, kDamaged);
    throw InputError(words);
  }
  const bool is_right = header.measurements > 0 && header.measurements <= kMaxDirections && header.taps > 0 && header.taps <= kMaxTaps &&
                        (header.delays == 0 || header.delays == 2 || header.delays == 2 * header.measurements);
  if (!is_right) refuse(name, kDamaged);
  SofaFile file{.sample_rate_hz = header.sample_rate_hz,
                .measurements = header.measurements,
                .taps = header.taps,
                .is_cartesian = header.is_cartesian != 0};
  file.sources.resize(3 * file.measurements);
  file.responses.resize(2 * file.measurements * file.taps);
  file.delays.resize(header.delays);
  for (std::vector<float>* values : {&file.sources, &file.responses, &file.delays})
    if (!read_all(pipe, values->data(), values->size() * sizeof(float))) refuse(name, kDamaged);
  if (!std::isfinite(file.sample_rate_hz) || !is_finite(file.sources) || !is_finite(file.responses) || !is_finite(file.delays))
    refuse(name, "it holds numbers that are not finite");
  return file;
}

}  // namespace

SofaFile parse_sofa(const std::string& bytes, const std::string& name) {
  if (!bytes.starts_with("\x89HDF\r\n\x1a\n")) refuse(name, "not a SOFA file: SOFA files are HDF5 files");
  std::array<int, 2> pipe{};
  if (::pipe2(pipe.data(), O_CLOEXEC) != 0) throw SystemError(name + ": cannot create a pipe to read it");
  const pid_t child = ::fork();
  if (child == 0) {
    ::close(pipe[0]);
    run_child(pipe[1], bytes, name);
  }
  ::close(pipe[1]);
  const auto end = [&] {
    ::close(pipe[0]);
    if (child > 0) ::kill(child, SIGKILL);  // its result was read
    while (child > 0 && ::waitpid(child, nullptr, 0) < 0 && errno == EINTR) {
    }
  };
  if (child < 0) {
    end();
    throw SystemError(name + ": cannot create a process to read it");
  }
  try {
    SofaFile file = receive(pipe[0], name);
    end();
    return file;
  } catch (...) {
    end();
    throw;
  }
}

}  // namespace carillon::head
