#include "precompute/simulation/outputs.hpp"

#include <fmt/core.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "precompute/simulation/emission_input.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/json.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/base/version.hpp"
#include "runtime/render/sound/sound_store.hpp"
#include "runtime/render/sound/spectrogram.hpp"
#include "runtime/render/sound/wav_header.hpp"

namespace carillon::simulation {
namespace {

namespace fs = std::filesystem;
using transient::EnergyBook;

static_assert(std::endian::native == std::endian::little);

template <typename T>
void put(std::string& bytes, T value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

/// channels: (receivers)(frames) [Pa]. 32-bit floats in pascals times `gain_per_pa`. Throws SystemError for write errors.
void write_sound(const std::filesystem::path& file, const std::vector<std::vector<double>>& channels, int rate_hz, double gain_per_pa) {
  const std::size_t frames = channels.empty() ? 0 : channels[0].size();
  base::WholeFile whole(file);
  whole.append(sound::make_wav_header(rate_hz, channels.size(), {.bits = 32, .is_float = true}, frames));
  std::string piece;
  for (std::size_t i = 0; i < frames; ++i) {
    for (const std::vector<double>& channel : channels) put(piece, static_cast<float>(gain_per_pa * channel[i]));
    if (piece.size() > 1 << 20) {
      whole.append(piece);
      piece.clear();
    }
  }
  whole.append(piece);
  whole.commit();
}

/// PNG bytes of sound::make_spectrogram_png() of the same channels. Long sounds are buffered in `folder`. Throws SystemError.
std::string draw_spectrogram(const std::vector<std::vector<double>>& channels, int rate_hz, const std::string& title,
                             const std::filesystem::path& folder) {
  sound::SoundStore store(rate_hz, channels.size(), base::Spool(folder, "sound"));
  std::vector<float> frame(channels.size());
  for (std::size_t i = 0; i < channels[0].size(); ++i) {
    for (std::size_t c = 0; c < channels.size(); ++c) frame[c] = static_cast<float>(channels[c][i]);
    store.append(frame);
  }
  return sound::make_spectrogram_png(store, title);
}

constexpr double kFullScalePa = 1.0;       // of a WAV file; louder sounds are normalised to a peak of 1
constexpr double kTargetBookError = 1e-6;  // target energy error over the largest energy
constexpr double kBookErrorFactor =
    3.0;  // largest deviation from the square law: 2.7 in 11 scenes with errors above the target, steps down to a sixth

base::Json describe(const EnergyBook& book) {
  base::Json json = base::Json::object();
  json.set("time_s", base::significant(book.time_s, 9));
  for (const auto& [name, value] : {std::pair{"kinetic_j", book.kinetic_j},
                                    {"elastic_j", book.elastic_j},
                                    {"dissipated_j", book.dissipated_j},
                                    {"work_j", book.work_j},
                                    {"error_j", book.error_j},
                                    {"relative_error", book.relative_error}})
    json.set(name, base::finite_or_null(value, base::significant, 9));
  return json;
}

/// Step at which the energy error should reach kTargetBookError (error ~ step^2). Empty: already reached.
std::optional<double> find_closing_step(double step_s, double book_error) {
  if (!(book_error > kTargetBookError) || !std::isfinite(book_error)) return std::nullopt;
  return step_s * std::sqrt(kTargetBookError / (kBookErrorFactor * book_error));
}

/// Without file names: the stored picture equals that of a manual run.
std::string make_title(const Simulation& simulation) {
  std::vector<std::string> names;
  for (const job::SimulatedBody& body : simulation.spec.bodies) names.push_back(base::printable(body.name));
  return fmt::format("{}: {} elements", fmt::join(names, ", "), simulation.bodies.assembly->element_count());
}

}  // namespace

std::string write_outputs(const comm::Communicator& comm, Simulation& simulation, double seconds) {
  const job::SimulationSpec& spec = simulation.spec;
  std::string result;
  double peak = 0;
  std::vector<std::vector<double>> channels;
  if (simulation.sound) {
    simulation.sound->finish();
    const emission::Options options = make_emission_options(spec, simulation.motion->get_steps_per_sample(), false);
    for (std::size_t r = 0; r < options.receivers.size(); ++r) channels.push_back(simulation.sound->calc_sound(r));
    for (const auto& channel : channels)
      for (const double p : channel) peak = std::max(peak, std::abs(p));
  }
  const transient::ExternalForces::Energy touch = simulation.contacts->calc_energy();
  const double cpu[2] = {comm.sum(simulation.steps_cpu_s), comm.sum(simulation.sound_cpu_s)};
  if (simulation.film) simulation.film->finish();
  comm.agree([&] {
    if (!comm.is_root()) return;
    const EnergyBook& book = simulation.books.back();
    const double gain = peak > kFullScalePa ? kFullScalePa / peak : 1.0;
    std::string picture;  // before any output
    if (!spec.spectrogram.empty())
      picture = draw_spectrogram(channels, spec.sample_rate_hz, make_title(simulation), base::find_folder(spec.spectrogram));
    if (!spec.sound.empty()) write_sound(spec.sound, channels, spec.sample_rate_hz, gain);
    if (!spec.spectrogram.empty()) base::write_file(spec.spectrogram, picture);
    double worst = 0;
    for (const EnergyBook& one : simulation.books) worst = std::max(worst, std::abs(one.relative_error));
    // CPU time, independent of other load.
    const double rate = static_cast<double>(simulation.bodies.assembly->element_count()) *
                        static_cast<double>(simulation.motion->get_step_count() - simulation.first_step) / std::max(1e-9, cpu[0]);
    base::Json record = base::Json::object();
    record.set("version", base::describe("carillon-simulate")).set("job_sha256", simulation.job_sha256);
    record.set("job", spec.file.filename().string()).set("duration_s", spec.duration_s).set("sample_rate_hz", spec.sample_rate_hz);
    record.set("step_s", base::significant(simulation.motion->get_step_s(), 9)).set("steps", simulation.motion->get_step_count());
    record.set("elements", static_cast<std::int64_t>(simulation.bodies.assembly->element_count())).set("ranks", comm.size());
    record.set("seconds", base::decimals(seconds, 3)).set("cpu_seconds", base::decimals(cpu[0] + cpu[1], 3));
    record.set("sound_cpu_seconds", base::decimals(cpu[1], 3));
    record.set("element_steps_per_second", base::significant(rate, 4));
    record.set("peak_pa", base::finite_or_null(peak, base::significant, 6)).set("gain_per_pa", base::significant(gain, 9));
    record.set("book_error", base::finite_or_null(worst, base::significant, 3));
    const std::optional<double> closing_step_s = find_closing_step(simulation.motion->get_step_s(), worst);
    record.set("closing_step_s", base::finite_or_null(closing_step_s.value_or(NAN), base::significant, 3));
    record.set("contact_stored_j", base::significant(touch.stored_j, 9))
        .set("contact_dissipated_j", base::significant(touch.dissipated_j, 9));
    for (const transient::BallStriker& ball : simulation.contacts->get_strikers()) {
      base::Json striker = base::Json::object();
      for (const double x : ball.position_m) striker["position_m"].add(base::significant(x, 9));
      for (const double x : ball.velocity_m_s) striker["velocity_m_s"].add(base::significant(x, 9));
      for (const double x : ball.spin_rad_s) striker["angular_velocity_rad_s"].add(base::significant(x, 9));
      record["strikers"].add(std::move(striker));
    }
    for (const Bent& bent : simulation.bodies.bent) {
      base::Json one = base::Json::object();
      one.set("body", spec.bodies[bent.body].name).set("displacement_m", base::significant(bent.displacement_m, 6));
      one.set("energy_j", base::significant(bent.energy_j, 9)).set("cpu_seconds", base::decimals(bent.cpu_s, 3));
      if (bent.mode_hz > 0.0) one.set("mode_hz", base::significant(bent.mode_hz, 9));
      record["bent"].add(std::move(one));
    }
    for (const EnergyBook& one : simulation.books) record["books"].add(describe(one));
    for (const std::string& warning : spec.warnings) record["warnings"].add(warning);
    if (!spec.record.empty()) base::write_file(spec.record, record.text());
    result = fmt::format(
        "{:.6g} s in {} steps of {:.4g} s, {:.3g} element-steps a second of CPU time, sound {:.1f} % of the CPU time\n"
        "energy: kinetic {:.4g} J, elastic {:.4g} J, dissipated {:.4g} J, put in {:.4g} J; the book closes to {:.1e}",
        book.time_s, simulation.motion->get_step_count(), simulation.motion->get_step_s(), rate,
        100.0 * cpu[1] / std::max(1e-9, cpu[0] + cpu[1]), book.kinetic_j, book.elastic_j, book.dissipated_j, book.work_j, worst);
    if (closing_step_s)
      result += fmt::format("\nthe book is expected to close to {:g} with \"step_s\": {:.2e} (its error falls with the square of the step)",
                            kTargetBookError, *closing_step_s);
    if (simulation.sound)
      result += fmt::format("\npeak {:.4g} Pa{}", peak, gain < 1.0 ? fmt::format(", the file has it as 1 (gain {:.4g})", gain) : "");
    for (const job::SimulationOutput& output : job::kSimulationOutputs)
      if (!(spec.*output.file).empty()) {
        std::error_code error;  // the folder may be gone
        const fs::path whole = fs::absolute(spec.*output.file, error);
        result += "\n" + (error ? spec.*output.file : whole).string();
      }
  });
  return result;
}

}  // namespace carillon::simulation
