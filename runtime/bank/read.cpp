// Reader of banks from untrusted bytes.
// Method: the seal locates the arrays; the file is read once, front to back, arrays directly to their destination, and hashed on the way.
//   The content is checked after the digest.
// Deviations: HDF5 is not used: libhdf5 1.10.8 crashed and hung on files with one changed byte. The HDF5 structure serves other programs.
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <functional>
#include <map>
#include <numbers>

#include "runtime/bank/bank.hpp"
#include "runtime/bank/layout.hpp"
#include "runtime/bank/packed/shapes.hpp"
#include "runtime/bank/packed/surface.hpp"
#include "runtime/bank/seal.hpp"
#include "runtime/base/large.hpp"
#include "runtime/base/sha256.hpp"

namespace carillon::bank {
namespace {

/// Open regular file.
class File {
 public:
  explicit File(const std::filesystem::path& path) : name_(path.string()) {
    // Non-blocking: a FIFO without a writer must not hang the program.
    descriptor_ = ::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC | O_NOCTTY);
    if (descriptor_ < 0) {
      const int error = errno;
      if (error == ENOENT || error == ENOTDIR) throw InputError(name_ + ": no such file; give the path of a bank");
      throw InputError(fmt::format("{}: cannot be opened: {}", name_, std::strerror(error)));
    }
    struct stat status {};
    if (::fstat(descriptor_, &status) != 0 || !S_ISREG(status.st_mode)) {
      ::close(descriptor_);
      throw InputError(
          fmt::format("{}: {}; give the path of a bank file", name_, S_ISDIR(status.st_mode) ? "is a folder" : "is not a regular file"));
    }
    length_ = static_cast<std::uint64_t>(status.st_size);
  }
  ~File() { ::close(descriptor_); }
  File(const File&) = delete;
  File& operator=(const File&) = delete;

  const std::string& name() const { return name_; }
  std::uint64_t length() const { return length_; }

  /// Fills `bytes` from `offset`. SystemError on read errors, InputError if the file ends early.
  void read(std::uint64_t offset, std::span<std::byte> bytes) const {
    while (!bytes.empty()) {
      const ssize_t got = ::pread(descriptor_, bytes.data(), bytes.size(), static_cast<off_t>(offset));
      if (got < 0 && errno == EINTR) continue;
      if (got < 0) throw SystemError(fmt::format("{}: cannot be read at byte {}: {}", name_, offset, std::strerror(errno)));
      if (got == 0)
        throw InputError(fmt::format("{}: truncated at byte {} while it was read; read it again when its writer is done", name_, offset));
      offset += static_cast<std::uint64_t>(got);
      bytes = bytes.subspan(got);
    }
  }

  Seal read_seal() const {
    std::string head(std::min<std::uint64_t>(length_, kSealBytes), '\0');
    read(0, std::as_writable_bytes(std::span(head)));
    return parse_seal(head, length_, name_);
  }

 private:
  std::string name_;
  int descriptor_ = -1;
  std::uint64_t length_ = 0;
};

const Extent& get_extent(const Seal& seal, const std::string& field, const std::string& name) {
  const auto found = seal.extents.find(field);
  if (found == seal.extents.end()) throw InputError(fmt::format("{}: the array {} is missing; write the bank again", name, field));
  return found->second;
}

/// Rows of an array with at least one index.
std::uint64_t get_rows(const Seal& seal, const std::string& field, const std::string& name) {
  const Extent& extent = get_extent(seal, field, name);
  if (extent.shape.empty())
    throw InputError(fmt::format("{}: {} is a single number instead of an array; write the bank again", name, field));
  return extent.shape[0];
}

/// "<f8 (4, 3)"
std::string describe(const std::string& dtype, const std::vector<std::uint64_t>& shape) {
  return shape.empty() ? dtype + " alone" : fmt::format("{} ({})", dtype, fmt::join(shape, ", "));
}

/// Throws unless type and shape in the file are as required by the other arrays.
void check_extent(const Field& wanted, const Extent& extent, const std::string& name) {
  if (extent.dtype != wanted.dtype || extent.shape != wanted.shape) {
    throw InputError(fmt::format("{}: arrays disagree: {} is {}, {} is required; write the bank again", name, wanted.name,
                                 describe(extent.dtype, extent.shape), describe(wanted.dtype, wanted.shape)));
  }
}

/// Fills `bytes` from `offset` of the file.
using Source = std::function<void(std::uint64_t offset, std::span<std::byte> bytes)>;

struct Loaded {
  Bank bank;
  FileForm form;
};

/// True if the file has any array of the group.
bool has_group(const Seal& seal, const std::string& group) {
  const auto first = seal.extents.lower_bound(group + "/");
  return first != seal.extents.end() && first->first.starts_with(group + "/");
}

/// Sizes the arrays by the seal, which bounds their sum by the length of the file. Checks each extent before it allocates: rows times three
/// could exceed the file even if a declared shape does not.
class Allocator {
 public:
  Allocator(const Seal& seal, const std::string& name, Loaded& loaded)
      : seal_(seal), name_(name), bank_(loaded.bank), form_(loaded.form), modes_(get_rows(seal, "modes/eigenvalue", name)) {}

  void run() {
    for (const auto& [field, values] :
         {std::pair("modes/eigenvalue", &bank_.eigenvalue_rad2_s2), std::pair("modes/frequency_hz", &form_.freq_hz),
          std::pair("modes/decay", &bank_.decay_per_s), std::pair("modes/residual", &bank_.residual),
          std::pair("modes/radiation_gain", &bank_.radiation_gain), std::pair("modes/shape_scale", &bank_.shape_scale)})
      make_table(field, "<f8", {modes_}, *values, modes_);
    form_.is_packed = has("mesh/packed");
    form_.is_packed ? make_packed() : make_surface();
    make_text("solve/element", form_.element);
    make_text("solve/mass", form_.mass);
    make_text("provenance", form_.provenance);
    make_modes();
    if (has("material/regions")) make_text("material/regions", form_.regions);
    if (has_group(seal_, "supports")) make_supports();
    if (has_group(seal_, "radiation")) make_radiation();
    if (has_group(seal_, "nonlinear")) make_nonlinear();
    if (has_group(seal_, "sensitivity")) make_sensitivities();
    if (has_group(seal_, "proof")) make_proof();
  }

 private:
  bool has(const char* field) const { return seal_.extents.contains(field); }
  std::uint64_t find_rows(const char* field) const { return get_rows(seal_, field, name_); }
  void check(const char* field, const char* dtype, std::vector<std::uint64_t> shape) const {
    check_extent({field, dtype, std::move(shape), "", "", nullptr}, get_extent(seal_, field, name_), name_);
  }
  template <class Values>
  void make_table(const char* field, const char* dtype, std::vector<std::uint64_t> shape, Values& values, std::uint64_t size) const {
    check(field, dtype, std::move(shape));
    values.resize(size);
  }
  template <class Values>
  void make_list(const char* field, const char* dtype, Values& values) const {
    const std::uint64_t rows = find_rows(field);
    make_table(field, dtype, {rows}, values, rows);
  }
  void make_text(const char* field, std::string& text) const {
    const Extent& extent = get_extent(seal_, field, name_);
    if (!extent.dtype.starts_with("|S"))
      throw InputError(fmt::format("{}: arrays disagree: {} is not text; write the bank again", name_, field));
    text.resize(extent.bytes);
  }

  void make_packed() const {
    Packing& packing = bank_.packing.emplace();
    make_list("mesh/packed", "|u1", form_.packed_surface);
    make_list("modes/packed_shape", "|u1", form_.packed_shape);
    make_list("pack/witness", "<i4", packing.witness);
    const std::uint64_t witnesses = packing.witness.size();
    make_table("pack/witness_shape", "<i2", {witnesses, modes_, 3}, packing.witness_shape, witnesses * modes_ * 3);
    if (!has("mesh/packed_order")) return;
    make_list("mesh/packed_order", "|u1", form_.packed_order);
    if (form_.packed_order.empty()) throw InputError(name_ + ": mesh/packed_order is empty; copy or pack the bank again");
  }
  void make_surface() const {
    const std::uint64_t vertices = find_rows("mesh/vertices"), triangles = find_rows("mesh/triangles");
    check("mesh/vertices", "<f8", {vertices, 3});
    check("mesh/triangles", "<i4", {triangles, 3});
    bank_.shape_bytes = get_extent(seal_, "modes/shape", name_).dtype == "|i1" ? 1 : 2;
    check("modes/shape", bank_.shape_bytes == 1 ? "|i1" : "<i2", {vertices, modes_, 3});
    bank_.vertices_m.resize(vertices);
    bank_.triangles.resize(triangles);
    if (bank_.shape_bytes == 1)
      form_.narrow_shape.resize(vertices * modes_ * 3);
    else
      base::reserve_large(bank_.shape, vertices * modes_ * 3);  // load() appends
  }
  /// Fields per mode and the damping law, since versions 1.1 and 1.4; absent ones keep Bank's initialisers.
  void make_modes() const {
    for (auto [field, cents] : {std::pair("modes/algebraic_error_cents", &bank_.algebraic_error_cents),
                                std::pair("modes/discretisation_error_cents", &bank_.discretisation_error_cents),
                                std::pair("modes/facet_error_cents", &bank_.facet_error_cents)}) {
      if (has(field)) make_list(field, "<f8", *cents);
    }
    if (has("modes/corrected_frequency_hz")) {
      make_list("modes/corrected_frequency_hz", "<f8", bank_.corrected.freq_hz);
      make_list("modes/corrected_decay", "<f8", bank_.corrected.decay_per_s);
      make_list("modes/corrected_error_cents", "<f8", bank_.corrected.error_cents);
      make_list("modes/correction", "|u1", bank_.corrected.correction);
    }
    if (!has_group(seal_, "damping")) return;
    make_text("damping/law", form_.damping_law);
    make_list("damping/coefficient", "<f8", bank_.damping.coefficient);
    make_list("damping/power", "<f8", bank_.damping.power);
    make_list("damping/freq_hz", "<f8", bank_.damping.freq_hz);
    make_list("damping/loss_factor", "<f8", bank_.damping.loss_factor);
  }
  void make_supports() const {
    make_text("supports/text", form_.supports);
    Supports& supports = bank_.supports;
    const std::uint64_t count = find_rows("supports/area_m2");
    make_table("supports/centre_m", "<f8", {count, 3}, supports.centre_m, count);
    make_table("supports/normal", "<f8", {count, 3}, supports.normal, count);
    make_table("supports/area_m2", "<f8", {count}, supports.area_m2, count);
    make_table("supports/thickness_m", "<f8", {count}, supports.thickness_m, count);
    make_table("modes/support_reaction", "<f8", {modes_, count, 6}, supports.reaction, modes_ * count * 6);
    make_table("modes/support_energy", "<f8", {modes_, count}, supports.energy, modes_ * count);
  }
  void make_radiation() const {
    Multipoles& air = bank_.multipoles;
    const std::uint64_t coefficients = find_rows("radiation/coefficient");
    make_table("radiation/freq_hz", "<f8", {modes_}, air.freq_hz, modes_);
    make_table("radiation/order", "<i4", {modes_}, air.order, modes_);
    make_table("radiation/scale", "<f8", {modes_}, air.scale, modes_);
    make_table("radiation/decay", "<f8", {modes_}, air.decay_per_s, modes_);
    make_table("radiation/added_mass", "<f8", {modes_}, air.added_mass, modes_);
    make_table("radiation/error_db", "<f8", {modes_}, air.error_db, modes_);
    make_table("radiation/coefficient", "<i2", {coefficients, 2}, air.coefficient, 2 * coefficients);
    if (has("radiation/mixing_count")) {
      const std::uint64_t parts = find_rows("radiation/mixing_motion");
      make_table("radiation/mixing_count", "<i4", {modes_}, air.mixing.count, modes_);
      make_table("radiation/mixing_motion", "<i4", {parts}, air.mixing.motion, parts);
      make_table("radiation/mixing_part", "<f8", {parts}, air.mixing.part, parts);
    }
    make_text("radiation/method", form_.radiation_method);
  }
  void make_nonlinear() const {
    QuarticEnergy& energy = bank_.quartic;
    make_list("nonlinear/modes", "<i4", energy.modes);
    make_text("nonlinear/form", form_.nonlinear_form);
    const std::uint64_t modes = energy.modes.size();
    std::uint64_t rows = 0;
    if (has("nonlinear/A")) {
      rows = find_rows("nonlinear/A");
      make_table("nonlinear/A", "<f4", {rows, count_pairs(modes)}, energy.rows, rows * count_pairs(modes));
    } else {
      const Extent& gradient = get_extent(seal_, "nonlinear/G", name_);
      const std::uint64_t points = find_rows("nonlinear/weight");
      const std::uint64_t parts = gradient.shape.size() == 3 && gradient.shape[1] == 6 ? 6 : 9, strains = parts == 6 ? 3 : 6;
      rows = find_rows("nonlinear/stress");
      make_table("nonlinear/G", "<f4", {points, parts, modes}, energy.gradient, points * parts * modes);
      make_table("nonlinear/stress", "<f4", {rows, points, strains}, energy.stress, rows * points * strains);
      make_table("nonlinear/weight", "<f8", {points}, energy.weight, points);
    }
    if (has("nonlinear/linear")) make_table("nonlinear/linear", "<f8", {rows, modes}, energy.linear, rows * modes);
    // list_fields() divides by these: an empty shape has no bytes that would bound the others.
    if (const std::string fault = find_size_fault(energy); energy.is_empty() || !fault.empty())
      throw InputError(fmt::format("{}: {}; write the bank again", name_, fault.empty() ? "nonlinear/modes names no mode" : fault));
  }
  void make_sensitivities() const {
    Sensitivities& s = bank_.sensitivities;
    const std::uint64_t columns = find_rows("sensitivity/modes"), sites = find_rows("sensitivity/vertex");
    s.count = find_rows("sensitivity/by_parameter");
    const Extent& values = get_extent(seal_, "sensitivity/by_parameter", name_);
    const std::uint64_t parameters = values.shape.size() == 2 ? values.shape[1] : 0;
    if (columns == 0) throw InputError(name_ + ": sensitivity/modes is empty; write the bank again");
    make_table("sensitivity/modes", "<i4", {columns, 2}, s.modes, columns);
    make_table("sensitivity/scale", "<f8", {columns}, s.scale, columns);
    make_table("sensitivity/density", "<i2", {sites, columns}, s.density, sites * columns);
    make_table("sensitivity/vertex", "<i4", {sites}, s.vertex, sites);
    make_table("sensitivity/normal", "<f4", {sites, 3}, s.normal, sites);
    make_table("sensitivity/area_m2", "<f4", {sites}, s.area_m2, sites);
    make_table("sensitivity/doubtful", "|u1", {sites}, s.doubtful, sites);
    make_table("sensitivity/by_parameter", "<f8", {s.count, parameters}, s.by_parameter, s.count * parameters);
    if (has("sensitivity/own_error_cents")) make_table("sensitivity/own_error_cents", "<f8", {s.count}, s.own_error_cents, s.count);
    make_text("sensitivity/parameters", form_.parameters);
  }
  void make_proof() const {
    Proof& proof = bank_.proof.emplace();
    make_list("proof/cut_hz", "<f8", proof.cut_hz);
    make_list("proof/below", "<i8", proof.below);
    make_list("proof/margin", "<f8", proof.margin);
    make_list("proof/rigid_per_component", "<i8", proof.rigid_per_component);
    make_list("proof/cluster_first", "<i8", proof.cluster_first);
    make_list("proof/cluster_count", "<i8", proof.cluster_count);
    make_text("proof/method", form_.proof_method);
    if (has("proof/below_band_hz")) make_list("proof/below_band_hz", "<f8", proof.below_band_hz);
    form_.has_complete_below = has("proof/complete_below_hz");
  }

  const Seal& seal_;
  const std::string& name_;
  Bank& bank_;
  FileForm& form_;
  std::uint64_t modes_;
};

std::string trim(std::string_view text) {
  const std::size_t last = text.find_last_not_of('\0');
  return std::string(text.substr(0, last == std::string_view::npos ? 0 : last + 1));
}

/// Reads the file from front to back into the arrays and compares the digest.
Loaded load(const Seal& seal, const std::string& name, const Source& read) {
  Loaded loaded;
  Allocator(seal, name, loaded).run();
  struct Target {
    std::uint64_t offset, bytes;
    std::byte* data;
  };
  std::vector<Target> targets;
  for (const Field& field : list_fields(loaded.bank, loaded.form)) {
    const Extent& extent = get_extent(seal, field.name, name);
    check_extent(field, extent, name);
    // The table points to const for the writer's sake; the memory belongs to `loaded`.
    if (extent.bytes > 0) targets.push_back({extent.offset, extent.bytes, static_cast<std::byte*>(const_cast<void*>(field.data))});
  }
  std::sort(targets.begin(), targets.end(), [](const Target& a, const Target& b) { return a.offset < b.offset; });
  targets.push_back({seal.length, 0, nullptr});

  constexpr std::uint64_t kPiece = 1 << 18;  // still cached when hashed
  base::Sha256 digest;
  std::vector<std::byte> buffer(std::min(seal.length, kPiece));
  std::uint64_t place = 0;
  const auto take = [&](std::byte* data, std::uint64_t bytes, bool is_shape = false) {
    for (std::uint64_t done = 0, step = 0; done < bytes; done += step, place += step) {
      step = std::min(bytes - done, kPiece);
      const std::span piece(data != nullptr ? data + done : buffer.data(), step);
      read(place, piece);
      digest.add(piece);
      if (!is_shape) continue;
      const auto* steps = reinterpret_cast<const std::int16_t*>(piece.data());
      loaded.bank.shape.insert(loaded.bank.shape.end(), steps, steps + piece.size() / sizeof *steps);
    }
  };
  take(nullptr, kTextBytes);
  place = kSealBytes;  // the digest does not cover itself
  for (const Target& target : targets) {
    if (target.offset < place) throw InputError(name + ": damaged seal: two arrays overlap; copy or write the bank again");
    take(nullptr, target.offset - place);
    const bool is_shape = target.bytes > 0 && target.data == reinterpret_cast<std::byte*>(loaded.bank.shape.data());
    take(is_shape ? nullptr : target.data, target.bytes, is_shape);
  }
  if (base::to_hex(digest.finish()) != seal.digest) {
    throw InputError(name +
                     ": checksum differs: bytes were changed since the bank was sealed; copy or write the bank again (or, if you changed "
                     "them, seal it again: docs/bank-format.md)");
  }
  return loaded;
}

/// Decodes packed mesh and shapes.
void unpack(Bank& bank, const FileForm& form, const std::string& name) {
  packed::Surface surface = packed::read_surface(std::as_bytes(std::span(form.packed_surface)), name);
  for (const double scale : bank.shape_scale)
    if (!std::isfinite(scale) || scale < 0.0)
      throw InputError(fmt::format("{}: a scale of shapes is {}; copy or pack the bank again", name, scale));
  bank.shape = packed::read_shapes(std::as_bytes(std::span(form.packed_shape)), surface, bank.shape_scale, name);
  bank.vertices_m.reserve(surface.places.size());
  for (std::size_t v = 0; v < surface.places.size(); ++v) bank.vertices_m.push_back(surface.find_vertex(v));
  bank.triangles = std::move(surface.triangles);
  if (!form.packed_order.empty()) packed::restore_order(std::as_bytes(std::span(form.packed_order)), bank.triangles, name);
  for (const std::int32_t vertex : bank.packing->witness)
    if (vertex < 0 || static_cast<std::size_t>(vertex) >= bank.vertex_count())
      throw InputError(fmt::format("{}: pack/witness names vertex {}, and there are {}; copy or pack the bank again", name, vertex,
                                   bank.vertex_count()));
}

/// Converts the file's form to the bank's.
Bank finish(Loaded&& loaded, const std::string& name) {
  Bank& bank = loaded.bank;
  const FileForm& form = loaded.form;
  if (form.is_packed) unpack(bank, form, name);
  if (form.complete > 1)
    throw InputError(fmt::format("{}: solve/complete is {}, neither 0 nor 1; write the bank again", name, form.complete));
  bank.complete = form.complete == 1;
  if (bank.shape_bytes == 1) bank.shape.assign(form.narrow_shape.begin(), form.narrow_shape.end());
  bank.element = trim(form.element);
  bank.mass = trim(form.mass);
  bank.provenance = trim(form.provenance);
  if (!form.damping_law.empty()) bank.damping.law = trim(form.damping_law);
  bank.regions = trim(form.regions);
  bank.supports.text = trim(form.supports);
  if (bank.proof) bank.proof->method = trim(form.proof_method);
  if (bank.multipoles.is_empty())
    bank.multipoles = {};  // bank without modes
  else
    bank.multipoles.method = trim(form.radiation_method);
  bank.sensitivities.parameters = trim(form.parameters);
  if (const std::string form_name = trim(form.nonlinear_form);
      !bank.quartic.is_empty() && form_name != (bank.quartic.is_of_points() ? "points" : "rows"))
    throw InputError(fmt::format("{}: nonlinear/form is \"{}\", and its arrays are those of the form \"{}\"; write the bank again", name,
                                 form_name, bank.quartic.is_of_points() ? "points" : "rows"));
  for (std::size_t i = 0; i < bank.mode_count(); ++i) {
    const double freq_hz = std::sqrt(bank.eigenvalue_rad2_s2[i]) / (2.0 * std::numbers::pi);
    const bool agrees = std::abs(form.freq_hz[i] - freq_hz) <= 1e-9 * std::abs(freq_hz);
    // An eigenvalue without a frequency is reported by calc_checks().
    if (!agrees && std::isfinite(freq_hz)) {
      throw InputError(fmt::format("{}: modes/frequency_hz[{}] is {} Hz, and its eigenvalue says {} Hz; write the bank again", name, i,
                                   form.freq_hz[i], freq_hz));
    }
  }
  return std::move(bank);
}

void require_sane(const Bank& bank, const std::string& name) {
  const auto faults = find_faults(bank);
  if (faults.empty()) return;
  const std::string more = faults.size() > 1 ? fmt::format(" (and {} more: carillon-bank check lists them)", faults.size() - 1) : "";
  throw InputError(fmt::format("{}: not a valid bank: {}{}; compute the bank again", name, faults[0], more));
}

}  // namespace

Bank read_bank_unchecked(const std::filesystem::path& path) {
  const File file(path);
  const Seal seal = file.read_seal();
  return finish(load(seal, file.name(), [&](std::uint64_t offset, std::span<std::byte> bytes) { file.read(offset, bytes); }), file.name());
}

Bank read_bank(const std::filesystem::path& path) {
  Bank bank = read_bank_unchecked(path);
  require_sane(bank, path.string());
  return bank;
}

Bank parse_bank(std::span<const std::byte> bytes, const std::string& name) {
  const auto head = bytes.first(std::min(bytes.size(), kSealBytes));
  const Seal seal = parse_seal({reinterpret_cast<const char*>(head.data()), head.size()}, bytes.size(), name);
  const auto copy = [&](std::uint64_t offset, std::span<std::byte> to) { std::memcpy(to.data(), bytes.data() + offset, to.size()); };
  Bank bank = finish(load(seal, name, copy), name);
  require_sane(bank, name);
  return bank;
}

Bank assemble_bank(const std::vector<FieldBytes>& arrays, const std::string& name) {
  Seal seal;
  std::map<std::string, std::span<const std::byte>> found;
  for (const auto& [field, bytes] : arrays) seal.length += bytes.size();
  for (const auto& [field, bytes] : arrays) {
    const Extent extent{.dtype = field.dtype, .shape = field.shape, .bytes = bytes.size()};
    std::uint64_t size = find_item_bytes(field.dtype);
    bool is_whole = size > 0;
    for (const std::uint64_t n : field.shape) {
      is_whole = is_whole && n <= seal.length && (n == 0 || size <= seal.length / n);  // as in a seal: no array exceeds the total
      size = is_whole ? size * n : 0;
    }
    if (!is_whole || size != bytes.size())
      throw InputError(fmt::format("{}: {} is declared as {}, and has {} bytes; write it again", name, field.name,
                                   describe(field.dtype, field.shape), bytes.size()));
    if (!found.emplace(field.name, bytes).second) throw InputError(fmt::format("{}: {} is there twice; write it again", name, field.name));
    seal.extents.emplace(field.name, extent);
  }
  Loaded loaded;
  Allocator(seal, name, loaded).run();
  for (const Field& wanted : list_fields(loaded.bank, loaded.form)) {
    const Extent& extent = get_extent(seal, wanted.name, name);
    check_extent(wanted, extent, name);
    const std::byte* from = found.at(wanted.name).data();
    if (extent.bytes == 0) continue;
    if (wanted.name == "modes/shape" && loaded.bank.shape_bytes == 2) {
      loaded.bank.shape.resize(extent.bytes / sizeof(std::int16_t));
      std::memcpy(loaded.bank.shape.data(), from, extent.bytes);
    } else {
      // As in load(): the memory belongs to this function.
      std::memcpy(const_cast<void*>(wanted.data), from, extent.bytes);
    }
  }
  Bank bank = finish(std::move(loaded), name);
  require_sane(bank, name);
  return bank;
}

std::array<int, 2> read_version(const std::filesystem::path& path) {
  const Seal seal = File(path).read_seal();
  return {seal.major, seal.minor};
}

}  // namespace carillon::bank
