// Method: datasets between lines "    -1"; of 58 and 58b those of function type 4 (frequency response) with motion over force.
// Source: Universal file datasets 15, 58, 58b, 164 and 2411, SDRC I-DEAS (University of Cincinnati, SDRL).
// Limitation: 58b with IEEE numbers at an even spacing; SI units but for accelerations in g.
#include <bit>
#include <cctype>
#include <cstring>

#include "runtime/exchange/frf.hpp"
#include "runtime/exchange/results_lines.hpp"

namespace carillon::exchange {
namespace {

constexpr int kFrfType = 4, kComplexSingle = 5, kComplexDouble = 6, kEven = 1, kFrequency = 18, kForce = 13;
constexpr double kStandardGravity = 9.80665, kLargest = 1e30, kHighestHz = 1e9;
constexpr std::size_t kMaxFrfs = 100'000, kUffLine = 80;
/// Least bytes of a line of a function: two numbers of 13 columns, or of 4 bytes.
constexpr std::size_t kLeastText = 26, kLeastBinary = 8;

class FrfReader {
 public:
  FrfReader(std::string_view bytes, const std::string& name) : lines_(bytes, name), name_(name) {}

  FrfSet read() {
    while (!lines_.is_at_end()) {
      const std::string_view mark = lines_.next("its header");
      if (lines_.cut(mark, 0, kUffLine).empty()) continue;
      if (!is_mark(mark)) lines_.fail("a dataset begins with a line -1; this is no universal file, or it is damaged");
      read_dataset(lines_.next("the number of a dataset"));
    }
    if (set_.frfs.empty())
      throw InputError(fmt::format("{}: the file has no frequency response functions (dataset 58, function type 4); write them", name_));
    for (auto& [node, x] : set_.nodes_m) x = 1.0 / units_per_metre_ * x;
    return std::move(set_);
  }

 private:
  bool is_mark(std::string_view line) const { return lines_.cut(line, 0, kUffLine) == "-1"; }

  void read_dataset(std::string_view head) {
    if (lines_.cut(head, 0, 7) == "58b") return read_function(head, true);
    const int number = lines_.number<int>(head, 0, kUffLine, "the number of a dataset");
    if (number == 58) return read_function(head, false);
    if (number == 164) units_per_metre_ = lines_.read_units().per_metre;
    for (std::string_view line = lines_.next("a dataset"); !is_mark(line); line = lines_.next("a dataset")) {
      if (number != 15 && number != 2411) continue;
      const auto node = lines_.number<std::int64_t>(line, 0, 10, "the number of a node");
      set_.nodes_m[node] =
          number == 15 ? lines_.vector(line, 40, 13, "a coordinate") : lines_.vector(lines_.next("the nodes"), 0, 25, "a coordinate");
    }
  }

  struct Axis {
    int type;
    std::string label, unit;
  };
  Axis read_axis() {
    const std::string_view line = lines_.next("the axes of a function");
    return {lines_.number<int>(line, 0, 10, "the type of an axis"), std::string(lines_.cut(line, 26, 20)),
            std::string(lines_.cut(line, 47, 20))};
  }

  void read_function(std::string_view head, bool is_binary) {
    for (int k = 0; k < 5; ++k) (void)lines_.next("the names of a function");
    const std::string_view kind = lines_.next("the kind of a function");
    const std::string_view size = lines_.next("the size of a function");
    const int function = lines_.number<int>(kind, 0, 5, "a function type");
    const int form = lines_.number<int>(size, 0, 10, "a number type"), spacing = lines_.number<int>(size, 20, 10, "a spacing");
    const auto count = lines_.number<std::size_t>(size, 10, 10, "the number of lines of a function");
    const double first = lines_.number<double>(size, 30, 13, "the first frequency"),
                 step = lines_.number<double>(size, 43, 13, "the spacing of frequencies");
    const Axis abscissa = read_axis(), ordinate = read_axis(), reference = read_axis();
    (void)read_axis();
    if (!is_binary && function != kFrfType) {
      while (!is_mark(lines_.next("a function"))) {
      }
      return;
    }
    if (count > lines_.remaining() / (is_binary ? kLeastBinary : kLeastText) + 1)
      lines_.fail("the file announces {} lines, but ends before them; it was cut short: write or copy it again", count);
    if (is_binary) check_binary(head, form, spacing);
    if (function != kFrfType) {
      (void)lines_.take(count * (form == 2 ? 4 : form == 6 ? 16 : 8), "a function");
      return read_end();
    }
    if (form != kComplexSingle && form != kComplexDouble) lines_.fail("a frequency response of real numbers; write complex ones");
    if (abscissa.type != kFrequency) lines_.fail("an abscissa of type {}; write functions of frequency (18)", abscissa.type);
    if (count < 1) lines_.fail("a function without values; write it again");
    if (set_.frfs.size() >= kMaxFrfs) lines_.fail("more than {} functions", kMaxFrfs);
    Frf frf;
    frf.response_node = lines_.number<std::int64_t>(kind, 41, 10, "the number of a node");
    frf.response_direction = lines_.number<int>(kind, 51, 4, "a direction");
    frf.reference_node = lines_.number<std::int64_t>(kind, 66, 10, "the number of a node");
    frf.reference_direction = lines_.number<int>(kind, 76, 4, "a direction");
    if (ordinate.type != 8 && ordinate.type != 11 && ordinate.type != 12)
      lines_.fail("an ordinate of type {}; write displacement (8), velocity (11) or acceleration (12)", ordinate.type);
    if (reference.type != kForce) lines_.fail("a reference of type {}; write functions per force (13)", reference.type);
    frf.motion = ordinate.type == 8 ? Motion::kDisplacement : ordinate.type == 11 ? Motion::kVelocity : Motion::kAcceleration;
    const bool is_in_g = ordinate.type == 12 && (ordinate.unit == "g" || ordinate.unit == "G" || ordinate.unit == "gn");
    frf.freq_hz.resize(count);
    frf.value.resize(count);
    for (std::size_t i = 0; i < count; ++i) frf.freq_hz[i] = first + step * static_cast<double>(i);
    if (is_binary)
      read_bytes(frf, head, form);
    else
      read_text(frf, form, spacing);
    for (std::complex<double>& value : frf.value) {
      if (!(std::abs(value) < kLargest)) lines_.fail("a value of {:g}; write the function again", std::abs(value));
      if (is_in_g) value *= kStandardGravity;
    }
    for (std::size_t i = 0; i < count; ++i)
      if (!(frf.freq_hz[i] >= 0.0 && frf.freq_hz[i] < kHighestHz) || (i > 0 && !(frf.freq_hz[i] > frf.freq_hz[i - 1])))
        lines_.fail("frequency {} of the function is {:g} Hz; they have to be ascending, from 0 to 1e9: write the function again", i + 1,
                    frf.freq_hz[i]);
    set_.frfs.push_back(std::move(frf));
    read_end();
  }

  void read_end() {
    std::string_view line = lines_.next("a function");
    while (lines_.cut(line, 0, kUffLine).empty()) line = lines_.next("a function");
    if (!is_mark(line)) lines_.fail("a function has more values than it announces; write it again");
  }

  void check_binary(std::string_view head, int form, int spacing) const {
    const int order = lines_.number<int>(head, 7, 6, "a byte order"), numbers = lines_.number<int>(head, 13, 6, "a format of numbers");
    if ((order != 1 && order != 2) || numbers != 2)
      lines_.fail("a binary dataset 58b in numbers of type {}, bytes of order {}; only IEEE numbers are read: write it in ASCII (58)",
                  numbers, order);
    if (spacing != kEven) lines_.fail("a binary dataset 58b with uneven spacing; write it in ASCII (58)");
    if (form != 2 && form != 4 && form != kComplexSingle && form != kComplexDouble)
      lines_.fail("a number type of {}; it has to be 2, 4, 5 or 6: write the function again", form);
  }

  void read_bytes(Frf& frf, std::string_view head, int form) {
    const bool is_swapped = (lines_.number<int>(head, 7, 6, "a byte order") == 1) != (std::endian::native == std::endian::little);
    const std::size_t width = form == kComplexSingle ? 4 : 8;
    const std::string_view bytes = lines_.take(2 * width * frf.value.size(), "a function");
    const auto number = [&](std::size_t i) {
      char copy[8];
      for (std::size_t b = 0; b < width; ++b) copy[is_swapped ? width - 1 - b : b] = bytes[width * i + b];
      if (width == 8) return std::bit_cast<double>(copy);
      float single = 0.0F;
      std::memcpy(&single, copy, 4);
      return static_cast<double>(single);
    };
    for (std::size_t i = 0; i < frf.value.size(); ++i) frf.value[i] = {number(2 * i), number(2 * i + 1)};
  }

  /// Fields of 13 columns, six a line, or in double precision of 20, four a line; at an uneven spacing each value after its frequency, one
  /// of 13 columns.
  void read_text(Frf& frf, int form, int spacing) {
    const bool is_even = spacing == kEven, is_double = form == kComplexDouble;
    const std::size_t width = is_double ? 20 : 13, head = is_even ? 0 : 13;
    const std::size_t per_line = is_double ? (is_even ? 2 : 1) : (is_even ? 3 : 2);
    std::string_view line;
    for (std::size_t i = 0; i < frf.value.size(); ++i) {
      const std::size_t at = i % per_line * (head + 2 * width);
      if (at == 0) line = lines_.next("a function");
      if (!is_even) frf.freq_hz[i] = lines_.number<double>(line, at, head, "a frequency");
      frf.value[i] = {lines_.number<double>(line, at + head, width, "a value of a function"),
                      lines_.number<double>(line, at + head + width, width, "a value of a function")};
    }
  }

  ResultsLines lines_;
  const std::string& name_;
  FrfSet set_;
  double units_per_metre_ = 1.0;
};

}  // namespace

FrfSet parse_frfs(std::string_view bytes, const std::string& name) { return FrfReader(bytes, name).read(); }

}  // namespace carillon::exchange
