#include "precompute/air/answers_file.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "runtime/base/descriptor.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/sha256.hpp"

namespace carillon::air {
namespace {

constexpr std::string_view kMagic = "carillon answers 2\n";
constexpr std::size_t kHead = kMagic.size() + 32, kHashBytes = 32;
constexpr std::uint64_t kMostNumbers = 100'000'000;

std::string read_bytes(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

[[noreturn]] void refuse(const std::filesystem::path& file, int error) {
  throw SystemError(fmt::format("{}: cannot be written: {}", file.string(), std::strerror(error)));
}

/// Complete answers in order and the end of the last one; 0 if the fingerprint differs.
std::pair<std::vector<WaveAnswer>, std::size_t> parse(std::string_view bytes, std::string_view fingerprint) {
  std::vector<WaveAnswer> answers;
  if (bytes.size() < kHead || !bytes.starts_with(kMagic) || bytes.substr(kMagic.size(), 32) != fingerprint) return {answers, 0};
  std::size_t at = kHead;
  while (bytes.size() - at >= sizeof(std::uint64_t)) {
    std::uint64_t count = 0;
    std::memcpy(&count, bytes.data() + at, sizeof count);
    if (count > kMostNumbers || bytes.size() - at < sizeof count + count * sizeof(double) + kHashBytes) break;
    const std::string_view record = bytes.substr(at, sizeof count + count * sizeof(double));
    const base::Sha256::Hash hash = base::calc_sha256(record);
    if (std::memcmp(hash.data(), bytes.data() + at + record.size(), kHashBytes) != 0) break;
    std::vector<double> numbers(count);
    std::memcpy(numbers.data(), record.data() + sizeof count, count * sizeof(double));
    std::optional<WaveAnswer> answer = unpack(numbers);
    if (!answer) break;
    answers.push_back(*std::move(answer));
    at += record.size() + kHashBytes;
  }
  return {std::move(answers), at};
}

std::string_view view(const std::array<unsigned char, 32>& fingerprint) {
  return {reinterpret_cast<const char*>(fingerprint.data()), fingerprint.size()};
}

}  // namespace

AnswersFile::AnswersFile(std::filesystem::path file, const std::array<unsigned char, 32>& fingerprint)
    : file_(std::move(file)), fingerprint_(fingerprint), whole_bytes_(parse(read_bytes(file_), view(fingerprint_)).second) {}

std::vector<WaveAnswer> AnswersFile::read() const { return parse(read_bytes(file_), view(fingerprint_)).first; }

void AnswersFile::save(const WaveAnswer& answer) {
  const bool is_new = whole_bytes_ == 0;
  const base::Descriptor descriptor(::open(file_.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0666));
  if (descriptor.get() < 0) refuse(file_, errno);
  // Drop an incomplete answer of a run that was killed while writing.
  if (::ftruncate(descriptor.get(), static_cast<off_t>(whole_bytes_)) != 0 || ::lseek(descriptor.get(), 0, SEEK_END) < 0)
    refuse(file_, errno);
  const std::vector<double> numbers = pack(answer);
  const std::uint64_t count = numbers.size();
  std::string record(sizeof count + count * sizeof(double), '\0');
  std::memcpy(record.data(), &count, sizeof count);
  std::memcpy(record.data() + sizeof count, numbers.data(), count * sizeof(double));
  const base::Sha256::Hash hash = base::calc_sha256(record);
  record.append(reinterpret_cast<const char*>(hash.data()), hash.size());
  if (is_new) record.insert(0, std::string(kMagic) + std::string(view(fingerprint_)));
  if (const int error = base::write_all(descriptor.get(), record); error != 0) refuse(file_, error);
  if (::fdatasync(descriptor.get()) != 0) refuse(file_, errno);
  whole_bytes_ += record.size();
}

void AnswersFile::remove() {
  std::error_code ignored;  // a missing file is no error
  std::filesystem::remove(file_, ignored);
  whole_bytes_ = 0;
}

std::array<unsigned char, 32> calc_fingerprint(const Radiator& radiator, const AirSolveOptions& options) {
  base::Sha256 hash;
  const auto add = [&](const auto& values) { hash.add(std::as_bytes(std::span(values))); };
  hash.add(kMagic);
  add(radiator.nodes_m);
  add(radiator.triangles);
  add(radiator.velocity);
  add(radiator.wave_number_1_m);
  const CouplingOptions coupling = options.coupling.value_or(CouplingOptions{});
  const std::array<double, 11> numbers{options.step,
                                       options.error_db,
                                       options.nearest_over_radius,
                                       options.tolerance,
                                       radiator.sphere.radius_m,
                                       static_cast<double>(radiator.rigid),
                                       coupling.has_rows ? 1.0 : 0.0,
                                       coupling.density_kg_m3,
                                       coupling.kept,
                                       static_cast<double>(radiator.nodes_m.size()),
                                       static_cast<double>(radiator.triangles.size())};
  add(numbers);
  add(radiator.sphere.centre_m);
  return hash.finish();
}

}  // namespace carillon::air
