// Method: SOFA is netCDF-4, which is HDF5 with dimension scales; built in memory.
// Source: AES69-2022, convention FreeFieldDirectivityTF 1.1; netCDF-4, file format specification (dimensions as scales of HDF5).
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <hdf5.h>
#include <hdf5_hl.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <ctime>
#include <map>
#include <numbers>
#include <numeric>
#include <string_view>
#include <vector>

#include "runtime/acoustics/radiation/transfers.hpp"
#include "runtime/bank/corrected.hpp"
#include "runtime/bank/hdf5_id.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/sort_order.hpp"
#include "runtime/base/vector.hpp"
#include "runtime/base/version.hpp"
#include "runtime/exchange/sofa.hpp"
#include "runtime/exchange/struck_point.hpp"

namespace carillon::exchange {
namespace {

using bank::Hdf5Id;
using bank::require;
using Texts = std::vector<std::pair<const char*, std::string>>;

constexpr double kFinestDeg = 1.0, kCoarsestDeg = 90.0;
constexpr double kFarthestM = 1e4;

/// A netCDF-4 file in memory.
class NetCdf {
 public:
  NetCdf() : access_(H5Pcreate(H5P_FILE_ACCESS), H5Pclose), creation_(H5Pcreate(H5P_FILE_CREATE), H5Pclose), file_(open(), H5Fclose) {}

  void add_texts(const Texts& texts) { put_texts(Hdf5Id(H5Gopen2(file_, "/", H5P_DEFAULT), H5Gclose), texts); }

  void add_dimension(const char* name, std::size_t size) {
    const hsize_t extent = size;
    const Hdf5Id space(H5Screate_simple(1, &extent, nullptr), H5Sclose);
    const Hdf5Id scale = make(name, H5T_IEEE_F32BE, space);
    require(H5DSset_scale(scale, fmt::format("This is a netCDF dimension but not a netCDF variable.{:10}", size).c_str()),
            "make a dimension");
    dimensions_.emplace_back(name, size);
  }

  /// `values`: row-major over the dimensions, which are letters. A variable of its own dimension's name is its scale.
  void add_variable(const char* name, std::string_view letters, const std::vector<double>& values, const Texts& texts) {
    std::vector<hsize_t> extents;
    for (const char letter : letters) {
      if (std::string_view(name) == letters) dimensions_.emplace_back(name, values.size());
      extents.push_back(find(letter).second);
    }
    const Hdf5Id space(H5Screate_simple(static_cast<int>(extents.size()), extents.data(), nullptr), H5Sclose);
    const Hdf5Id variable = make(name, H5T_IEEE_F64LE, space);
    require(H5Dwrite(variable, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()), "write a variable");
    if (std::string_view(name) == letters) {
      require(H5DSset_scale(variable, name), "make a dimension");
    } else {
      for (unsigned i = 0; i < letters.size(); ++i) {
        const Hdf5Id scale(H5Dopen2(file_, find(letters[i]).first.c_str(), H5P_DEFAULT), H5Dclose);
        require(H5DSattach_scale(variable, scale, i), "attach a dimension");
      }
    }
    put_texts(variable, texts);
  }

  std::string take_bytes() {
    require(H5Fflush(file_, H5F_SCOPE_GLOBAL), "complete the file in memory");
    const ssize_t size = H5Fget_file_image(file_, nullptr, 0);
    std::string bytes(static_cast<std::size_t>(std::max<ssize_t>(size, 0)), '\0');
    if (size <= 0 || H5Fget_file_image(file_, bytes.data(), bytes.size()) != size) throw SystemError("HDF5 left no whole file in memory");
    return bytes;
  }

 private:
  hid_t open() {
    require(H5Pset_fapl_core(access_, 1 << 20, false), "work in memory");
    // netCDF takes variables in their order of creation.
    require(H5Pset_link_creation_order(creation_, H5P_CRT_ORDER_TRACKED | H5P_CRT_ORDER_INDEXED), "keep an order");
    require(H5Pset_attr_creation_order(creation_, H5P_CRT_ORDER_TRACKED | H5P_CRT_ORDER_INDEXED), "keep an order");
    return H5Fcreate("sofa", H5F_ACC_TRUNC, creation_, access_);
  }

  Hdf5Id make(const char* name, hid_t type, hid_t space) {
    const Hdf5Id creation(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
    require(H5Pset_attr_creation_order(creation, H5P_CRT_ORDER_TRACKED | H5P_CRT_ORDER_INDEXED), "keep an order");
    return {H5Dcreate2(file_, name, type, space, H5P_DEFAULT, creation, H5P_DEFAULT), H5Dclose, name};
  }

  static void put_texts(hid_t object, const Texts& texts) {
    for (const auto& [name, text] : texts) {
      const Hdf5Id type(H5Tcopy(H5T_C_S1), H5Tclose);
      require(H5Tset_size(type, std::max<std::size_t>(1, text.size())), "size a text");
      require(H5Tset_cset(type, H5T_CSET_UTF8), "set UTF-8");
      require(H5Tset_strpad(type, H5T_STR_NULLTERM), "pad a text");
      const Hdf5Id space(H5Screate(H5S_SCALAR), H5Sclose);
      const Hdf5Id attribute(H5Acreate2(object, name, type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose, name);
      require(H5Awrite(attribute, type, text.c_str()), "write an attribute");
    }
  }

  const std::pair<std::string, std::size_t>& find(char letter) const {
    return *std::find_if(dimensions_.begin(), dimensions_.end(), [letter](const auto& one) { return one.first[0] == letter; });
  }

  Hdf5Id access_, creation_, file_;
  std::vector<std::pair<std::string, std::size_t>> dimensions_;
};

struct Receivers {
  std::vector<double> spherical;  // (R, 3) azimuth, elevation [degree], distance [m]
  std::vector<Vec3> place_m;      // (R) mesh axes
};

/// Rings of equal elevation, with one receiver at each pole.
Receivers make_receivers(const SofaOptions& options, const Vec3& centre_m) {
  const auto rings = static_cast<int>(std::lround(180.0 / options.step_deg));
  Receivers receivers;
  for (int ring = 0; ring <= rings; ++ring) {
    const bool is_pole = ring == 0 || ring == rings;
    for (int i = 0; i < (is_pole ? 1 : 2 * rings); ++i) {
      const double azimuth_deg = i * options.step_deg, elevation_deg = -90.0 + ring * options.step_deg;
      receivers.spherical.insert(receivers.spherical.end(), {azimuth_deg, elevation_deg, options.distance_m});
      const double a = azimuth_deg * std::numbers::pi / 180.0, e = elevation_deg * std::numbers::pi / 180.0;
      receivers.place_m.push_back(centre_m + options.distance_m * Vec3{std::cos(e) * std::cos(a), std::cos(e) * std::sin(a), std::sin(e)});
    }
  }
  return receivers;
}

/// Pressures of one frequency, or of a third octave, at all receivers.
struct Line {
  double freq_hz = 0.0;
  std::vector<std::complex<double>> pressure;  // (R)
};

/// One line for each mode, ascending in frequency.
std::vector<Line> calc_modes(const bank::Bank& bank, const SofaOptions& options, const std::vector<Vec3>& place_m) {
  const radiation::Transfers transfers(bank);
  std::vector<double> amplitude(bank.mode_count(), 1.0);
  if (options.strike_m) amplitude = find_struck_point(bank, *options.strike_m).calc_velocities();
  std::vector<Line> lines(bank.mode_count());
  std::vector<std::int32_t> modes(bank.mode_count());
  std::iota(modes.begin(), modes.end(), 0);
  std::vector<std::complex<float>> transfer(bank.mode_count());
  for (const Vec3& place : place_m) {
    transfers.evaluate(place, modes, transfer);
    for (std::size_t m = 0; m < lines.size(); ++m) {
      lines[m].freq_hz = bank.multipoles.freq_hz[m];
      const double k = 2.0 * std::numbers::pi * lines[m].freq_hz / bank.multipoles.sound_speed_ms;
      // The conjugate: of e^{+i omega t}. Transfers leave out the travel from the sphere.
      lines[m].pressure.push_back(amplitude[m] * std::conj(std::complex<double>(transfer[m])) *
                                  std::polar(1.0, -k * (options.distance_m - transfers.get_radius_m())));
    }
  }
  std::stable_sort(lines.begin(), lines.end(), [](const Line& a, const Line& b) { return a.freq_hz < b.freq_hz; });
  return lines;
}

/// Root of the sum of squares of the modes in each third octave that has some.
std::vector<Line> sum_bands(const std::vector<Line>& modes) {
  std::map<int, std::vector<double>> bands;
  for (const Line& mode : modes) {
    std::vector<double>& squares = bands[static_cast<int>(std::lround(10.0 * std::log10(mode.freq_hz / 1000.0)))];
    squares.resize(mode.pressure.size());
    for (std::size_t r = 0; r < squares.size(); ++r) squares[r] += std::norm(mode.pressure[r]);
  }
  std::vector<Line> lines;
  for (const auto& [band, squares] : bands) {
    Line& line = lines.emplace_back(Line{.freq_hz = 1000.0 * std::pow(10.0, 0.1 * band), .pressure = {}});
    for (const double square : squares) line.pressure.emplace_back(std::sqrt(square), 0.0);
  }
  return lines;
}

void check_options(const bank::Bank& bank, const SofaOptions& options) {
  if (bank.multipoles.is_empty())
    throw InputError(
        "the bank has no multipoles, so it has no directivity; compute it with \"radiation\": \"bem\", or add them by "
        "carillon-precompute --radiate");
  const double rings = 180.0 / options.step_deg;
  if (!(options.step_deg >= kFinestDeg && options.step_deg <= kCoarsestDeg) || std::abs(rings - std::round(rings)) > 1e-9)
    throw InputError(
        fmt::format("a step of {:g} degrees; give one from {:g} to {:g} that divides 180", options.step_deg, kFinestDeg, kCoarsestDeg));
  const double nearest_m = std::max(bank.multipoles.nearest_m, radiation::kNearestRadii * bank.multipoles.radius_m);
  if (!(options.distance_m >= nearest_m && options.distance_m <= kFarthestM))
    throw InputError(
        fmt::format("receivers at {:g} m; the multipoles of this body hold from {:.4g} m on, give a distance from there to {:g}",
                    options.distance_m, nearest_m, kFarthestM));
  if (options.has_bands && !options.strike_m)
    throw InputError("the level of third octaves depends on the blow; give its point by --strike X,Y,Z");
}

std::string describe_data(const bank::Bank& bank, const SofaOptions& options) {
  std::string text = options.has_bands ? "Each third octave: root of the sum of |p|^2 of its modes, right after the blow; phases are lost. "
                                       : "Each frequency: complex pressure p of one mode, e^(+i omega t). ";
  text += options.strike_m ? "Blow of 1 N s along the inward normal at " + fmt::format("({:.6g}, {:.6g}, {:.6g}) m of the mesh: p in Pa.",
                                                                                       (*options.strike_m)[0], (*options.strike_m)[1],
                                                                                       (*options.strike_m)[2])
                           : std::string("Unit modal velocity, 1 m kg^(1/2) / s: p in Pa s m^-1 kg^(-1/2).");
  if (bank::is_half_space(bank.multipoles)) text += " Above a rigid plane: directions below it are those of the mirror image.";
  return text;
}

}  // namespace

SofaFile make_sofa(const bank::Bank& given, const SofaOptions& options) {
  check_options(given, options);
  const bank::Bank bank = bank::choose_frequencies(given, bank::Frequencies::kCorrected);
  const bank::Multipoles& air = bank.multipoles;
  const Receivers receivers = make_receivers(options, air.centre_m);
  std::vector<Line> lines = calc_modes(bank, options, receivers.place_m);
  if (options.has_bands) lines = sum_bands(lines);

  NetCdf file;
  const std::string now = fmt::format("{:%Y-%m-%d %H:%M:%S}", fmt::gmtime(std::time(nullptr)));
  file.add_texts({{"Conventions", "SOFA"},
                  {"Version", "2.1"},
                  {"SOFAConventions", "FreeFieldDirectivityTF"},
                  {"SOFAConventionsVersion", "1.1"},
                  {"DataType", "TF"},
                  {"RoomType", "free field"},
                  {"Title", options.name},
                  {"DateCreated", now},
                  {"DateModified", now},
                  {"APIName", "carillon-bank"},
                  {"APIVersion", base::get_number()},
                  {"ApplicationName", "carillon-bank"},
                  {"ApplicationVersion", base::get_number()},
                  {"AuthorContact", "unknown"},
                  {"Organization", "unknown"},
                  {"License", "No license provided, ask the author for permission"},
                  {"DatabaseName", options.name},
                  {"SourceType", "vibrating body"},
                  {"SourceManufacturer", "computed"},
                  {"Comment", describe_data(bank, options)},
                  {"History", fmt::format("Computed: {}", air.method)},
                  {"Origin", "modes by finite elements, air by boundary elements"}});
  file.add_dimension("M", 1);
  file.add_dimension("R", receivers.place_m.size());
  std::vector<double> freq_hz, real, imaginary;
  for (const Line& line : lines) freq_hz.push_back(line.freq_hz);
  file.add_variable("N", "N", freq_hz, {{"LongName", "frequency"}, {"Units", "hertz"}});
  for (const auto& [name, size] : {std::pair("E", 1), {"C", 3}, {"I", 1}, {"S", 1}})
    file.add_dimension(name, static_cast<std::size_t>(size));
  const Texts cartesian{{"Type", "cartesian"}, {"Units", "metre"}}, spherical{{"Type", "spherical"}, {"Units", "degree, degree, metre"}};
  const auto with = [&](const char* reference) {
    Texts texts = cartesian;
    texts.emplace_back("Reference", reference);
    return texts;
  };
  file.add_variable("ListenerPosition", "IC", {0.0, 0.0, 0.0}, cartesian);
  file.add_variable("ListenerView", "IC", {1.0, 0.0, 0.0}, cartesian);
  file.add_variable("ListenerUp", "IC", {0.0, 0.0, 1.0}, cartesian);
  file.add_variable("ReceiverPosition", "RCI", receivers.spherical, spherical);
  const std::string centre = fmt::format("({:.9g}, {:.9g}, {:.9g}) m of the mesh: centre of the smallest sphere around the body",
                                         air.centre_m[0], air.centre_m[1], air.centre_m[2]);
  file.add_variable("SourcePosition", "IC", {0.0, 0.0, 0.0}, with(centre.c_str()));
  file.add_variable("SourceView", "IC", {1.0, 0.0, 0.0}, with("x of the mesh"));
  file.add_variable("SourceUp", "IC", {0.0, 0.0, 1.0}, with("z of the mesh"));
  file.add_variable("EmitterPosition", "ECI", {0.0, 0.0, 0.0}, cartesian);
  for (std::size_t r = 0; r < receivers.place_m.size(); ++r)
    for (const Line& line : lines) {
      real.push_back(line.pressure[r].real());
      imaginary.push_back(line.pressure[r].imag());
    }
  file.add_variable("Data.Real", "MRN", real, {});
  file.add_variable("Data.Imag", "MRN", imaginary, {});
  return {.bytes = file.take_bytes(), .receivers = receivers.place_m.size(), .frequencies = lines.size()};
}

}  // namespace carillon::exchange
