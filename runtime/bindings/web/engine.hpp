// Sound engine of a page, on the browser's audio thread: models from the workshop, interactive strikes, contacts, edits and motion, and
// recorded scenes.
//
//   web::Engine engine({.rate_hz = 48000.0});
//   engine.begin_surface(1, sizes), engine.add_to_surface(1, bytes), engine.add_model(1, 1, tables);
//   const int body = engine.add_body(1, settings);
//   engine.push(words);                  // event_words.hpp
//   engine.process(channels, 2, 128);
//
// One thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "runtime/bindings/web/event_words.hpp"
#include "runtime/events/events.hpp"
#include "runtime/scene/event_scheduler.hpp"
#include "runtime/synth/load_keeper.hpp"
#include "runtime/synth/model.hpp"
#include "runtime/synth/synthesiser.hpp"

namespace carillon::web {

/// Sizes of the parts of a surface in their order of transfer: triangles, largest motions, shapes.
struct SurfaceSizes {
  std::size_t triangles = 0, columns = 0, largest = 0, shape = 0;  // counts of triangles, columns, numbers, numbers
};

/// Playback of a recorded scene from a given time.
struct PlaybackRequest {
  std::vector<int> bodies;  // engine's body by number in the recording; -1: not played
  double at_s = 0.0;        // start in engine time
  double from_s = 0.0;      // start in the recording
};

/// Invariants: the caller numbers models and surfaces, the synthesiser numbers bodies. Interactive motion is continuous and not faster than
/// kFastestMs where possible. Every interactive contact, and every contact of a stopped recording, is ended.
class Engine {
 public:
  /// Throws InputError like synth::Synthesiser.
  explicit Engine(const synth::SynthesiserOptions& options);

  /// Models arrive in short pieces. Throw InputError for unknown numbers and wrong sizes.
  void begin_surface(int surface, const SurfaceSizes& sizes);
  void add_to_surface(int surface, std::span<const std::byte> bytes);
  void add_model(int model, int surface, std::span<const std::byte> tables);
  /// Bodies keep the models that they use.
  void release_surface(int surface) { surfaces_.erase(surface); }
  void release_model(int model) { models_.erase(model); }

  /// Throws InputError like the synthesiser.
  int add_body(int model, const synth::BodySettings& settings);
  /// The body continues with another model.
  void swap_model(int body, int model);
  /// Solo of one mode of a body, by its number in the bank; -1: all modes.
  void set_solo(int body, int bank_mode);
  void remove_body(int body);

  /// Pushes interactive events (event_words.hpp). Returns the number of rejected events; find_fault() has the last reason. Throws
  /// InputError for malformed rows.
  int push(std::span<const double> words);
  const std::string& find_fault() const { return fault_; }

  /// Starts a recorded scene. Its events arrive in pieces, in file order, at any time; those before from_s are skipped. Throws InputError
  /// for unknown bodies.
  void begin_playback(int playback, const PlaybackRequest& request);
  void add_to_playback(int playback, std::span<const double> words);
  /// Stops a playback: modes keep ringing, contacts end. Unknown numbers are ignored.
  void end_playback(int playback);

  /// The next frames, any number.
  void process(float* const* out, int channels, int frames);

  synth::Synthesiser& get_synthesiser() { return synthesiser_; }
  /// See synth::LoadKeeper.
  void keep_load(double share, double busy_s) { load_.keep(synthesiser_, share, busy_s); }

 private:
  struct Arriving {
    SurfaceSizes sizes;
    std::shared_ptr<synth::ModelSurface> surface;
  };
  struct PlayedBody {
    std::shared_ptr<const synth::Model> model;  // without solo
    int solo = -1;
    synth::EffectSet effects;
  };
  /// Last waypoint of an interactively moved body or listener.
  struct Way {
    double time_s = -1e300;
    Vec3 position_m{};
    events::Quaternion rotation{1.0, 0.0, 0.0, 0.0};
  };
  using ContactKey = std::tuple<std::int32_t, std::uint64_t>;
  struct HandContact {
    events::LastingContact record;  // last record
    double asked_s = 0.0;           // engine time of the page's last update
  };
  struct Playback {
    PlaybackRequest request;
    std::unique_ptr<scene::EventScheduler> scheduler;
    std::map<int, events::BodyMotion> before;  // last motion before from_s, by number in the recording
    std::map<ContactKey, events::LastingContact> touching;
    bool has_begun = false;
  };

  const std::shared_ptr<const synth::Model>& find_model(int model) const;
  PlayedBody& find_body(int body);
  bool push_soon(events::Event event);
  bool push_event(const events::Event& event);
  bool touch_soon(const events::LastingContact& contact);
  void hold_contacts();
  template <class Waypoint>
  bool move_soon(Way& way, Waypoint waypoint);
  void advance_playbacks(double now_s);
  bool play(Playback& playback, const events::Event& event) noexcept;

  double rate_hz_;
  synth::Synthesiser synthesiser_;
  synth::LoadKeeper load_;
  std::map<int, Arriving> surfaces_;
  std::map<int, std::shared_ptr<const synth::Model>> models_;
  std::map<int, PlayedBody> bodies_;
  std::map<int, Playback> playbacks_;
  std::map<int, Way> ways_;  // by body; -1: the listener
  std::map<ContactKey, HandContact> hand_contacts_;
  std::string fault_;
};

}  // namespace carillon::web
