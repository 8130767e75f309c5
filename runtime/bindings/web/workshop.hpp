// Operations of a page that are too slow for the audio thread: banks, edits, models, mallet blows, plans, recorded scenes.
//
//   web::Workshop workshop(48000.0);
//   workshop.add_bank(1, bytes, "cup.hdf");
//   const std::string facts = workshop.make_body(7, 1, scene_text, R"({"material": "glass"})");
//   engine.add_model(..., workshop.get_body(7).model->write_tables());
//
// Bodies are described as in scene files: `scene` is the text of a scene with one body, whose "bank" is ignored, so pages and
// carillon-render play the same. Results are JSON. All functions throw InputError, naming the bank or the line of the text, and then change
// nothing. One thread, never an audio thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/events/file.hpp"
#include "runtime/scene/scene.hpp"
#include "runtime/synth/model.hpp"

namespace carillon::web {

/// A body as played.
struct MadeBody {
  int bank = 0;
  scene::Scene scene;                         // with one body
  std::shared_ptr<const bank::Bank> played;   // edited, mounted, with the gains of the scene
  std::shared_ptr<const synth::Model> model;  // shares its surface with the previous model if possible
};

/// Invariants: the caller numbers banks, bodies and recordings; a body keeps its bank.
class Workshop {
 public:
  explicit Workshop(double rate_hz);

  /// Available choices: {"mallets": [{"name", "mass_kg", ...}], "materials": [{"name", "group", ...}], "effects": [...]}.
  std::string list_choices() const;

  /// Reads a bank; `name` is used in messages. Returns its properties without surface and shapes.
  std::string add_bank(int bank, std::span<const std::byte> bytes, const std::string& name);
  void remove_bank(int bank) { banks_.erase(bank); }
  const bank::Bank& get_bank(int bank) const { return *find_bank(bank); }
  /// Shape of a mode at every vertex, (V, 3) [kg^-1/2].
  std::vector<float> calc_shape(int bank, int mode) const;

  /// Change of a mode by cuts, at the corners of the triangles (T, 3) [cent / (mm m^2)]; NaN where doubtful. Empty: no sensitivities.
  std::vector<float> calc_density(int bank, int mode) const;

  /// Makes or replaces a body. `edits`: {"density_scale", "stiffness_scale", "size_scale", "damping_scale", "material": a name, "alphas":
  /// [s, 1/s], "loss": tan phi, "cuts": rows of place, radius and depth [m] (bank::Cut)}, all optional; damping_scale multiplies the
  /// resulting damping. Returns modes, change of the lowest by cuts, mass, centre of mass, surface and effects in the form of
  /// synth::BodySettings.
  std::string make_body(int body, int bank, std::string_view scene, std::string_view edits);
  void remove_body(int body) { bodies_.erase(body); }
  const MadeBody& get_body(int body) const;

  /// Mallet blow on the unedited state of the body, at rest: `scene` as in make_body, with a strike by "mallet", at `triangle` and its
  /// barycentric coordinates. Appends the forces in words of event_words.hpp to `words`, with `timing` and times from `time_s` on, for the
  /// engine's body `number`. Returns its result, scene::Blow.
  std::string make_blow(int body, std::string_view scene, std::int32_t triangle, const Vec3& barycentric, std::optional<double> time_s,
                        int number, std::vector<double>& words) const;
  /// A strike that excites one mode alone to `pressure_pa` at 1 m, at its largest motion.
  void make_ping(int body, int mode, double pressure_pa, int number, std::vector<double>& words) const;
  /// Pressure at 1 m per mode (m) after an impulse of 1 N s into the surface [Pa].
  std::vector<float> calc_levels(int body, std::int32_t triangle, const Vec3& barycentric) const;

  /// Effects needed by the bodies of a scene, with reasons: `scene` with the bodies `bodies`, in its order; `words`: the events so far, in
  /// order of time. {"bodies": [{"name", "effects": {NAME: {"on", "why"}}}]}.
  std::string make_plan(std::string_view scene, std::span<const int> bodies, std::span<const double> words) const;
  /// All effects that the body can need.
  synth::EffectSet find_possible(int body) const;

  /// Parses a contacts file for the bodies `bodies`, in its order. {"duration_s", "events", "rows", "bodies": [...], "warnings": [...]}.
  std::string add_recording(int recording, std::string_view text, const std::string& name, std::span<const int> bodies);
  void remove_recording(int recording) { recordings_.erase(recording); }
  /// make_plan() of a recording and the bodies it was read with.
  std::string plan_recording(std::string_view scene, int recording) const;
  /// All events as rows of event_words.hpp.
  std::span<const double> get_recording(int recording) const;
  /// Poses of a body: rows of time, centre of mass (3), rotation (4).
  std::vector<double> list_poses(int recording, int body) const;

 private:
  struct Recording {
    std::vector<int> bodies;
    events::Recording events;
    std::vector<double> words;
  };

  const std::shared_ptr<const bank::Bank>& find_bank(int bank) const;
  const Recording& find_recording(int recording) const;

  double rate_hz_;
  std::map<int, std::shared_ptr<const bank::Bank>> banks_;
  std::map<int, MadeBody> bodies_;
  std::map<int, Recording> recordings_;
};

}  // namespace carillon::web
