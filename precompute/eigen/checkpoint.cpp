#include "precompute/eigen/checkpoint.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "runtime/base/error.hpp"

namespace carillon::eigen {

CheckpointRequest vote(const comm::Communicator& comm, const Checkpoint& checkpoint) {
  const CheckpointRequest mine = checkpoint.ask();
  std::array<std::int32_t, 2> any{mine.stop ? 1 : 0, mine.save ? 1 : 0};
  comm.max(any);
  return {any[0] != 0, any[1] != 0};
}

void NumberWriter::add(double value) { bytes.append(reinterpret_cast<const char*>(&value), sizeof value); }

void NumberWriter::add(std::int64_t value) { bytes.append(reinterpret_cast<const char*>(&value), sizeof value); }

void NumberWriter::add(const std::vector<double>& values) {
  add(static_cast<std::int64_t>(values.size()));
  bytes.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(double));
}

void NumberWriter::add(const std::string& text) {
  add(static_cast<std::int64_t>(text.size()));
  bytes += text;
}

void NumberReader::take(void* to, std::size_t size) {
  if (size > bytes_.size() - at_) throw InputError("its numbers end early");
  if (size > 0) std::memcpy(to, bytes_.data() + at_, size);
  at_ += size;
}

double NumberReader::get_double() {
  double value = 0;
  take(&value, sizeof value);
  if (!std::isfinite(value)) throw InputError("a number in it is not finite");
  return value;
}

std::int64_t NumberReader::get_count(std::int64_t min, std::int64_t max) {
  std::int64_t value = 0;
  take(&value, sizeof value);
  if (value < min || value > max) throw InputError("a number in it is out of range");
  return value;
}

std::vector<double> NumberReader::get_doubles(std::int64_t max) {
  const std::int64_t left = static_cast<std::int64_t>((bytes_.size() - at_) / sizeof(double));
  const std::int64_t count = get_count(0, std::min(max, left));
  std::vector<double> values;
  values.reserve(count);
  for (std::int64_t i = 0; i < count; ++i) values.push_back(get_double());
  return values;
}

std::string NumberReader::get_text() {
  const std::int64_t size = get_count(0, static_cast<std::int64_t>(bytes_.size() - at_));
  std::string text(size, '\0');
  take(text.data(), text.size());
  return text;
}

void NumberReader::end() const {
  if (at_ != bytes_.size()) throw InputError("it has too many numbers");
}

}  // namespace carillon::eigen
