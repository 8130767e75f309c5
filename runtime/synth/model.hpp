// The modes of one bank made ready to be played: tables, in the order of audibility.
//
//   const auto model = synth::Model::make(bank, {.rate_hz = 48000.0});
//   synth::Voice voice(model);
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/synth/kernels.hpp"
#include "runtime/synth/nonlinear/coupled_modes.hpp"
#include "runtime/synth/pulse.hpp"

namespace carillon::radiation {
class Transfers;
}

namespace carillon::synth {

/// The surface of a body as strikes need it: which vertices a triangle has, and how the modes move there. Models of one body may share it.
struct ModelSurface {
  std::vector<std::array<std::int32_t, 3>> triangles;
  std::size_t columns = 0;          // of a row of shapes: groups x kGroup ringing modes, then the damped ones
  std::vector<std::int16_t> shape;  // (V, 3, columns), in steps of each mode's scale
  std::vector<float> largest;       // (groups x kGroup) largest squared motion of each ringing mode, in steps
};

struct ModelOptions {
  double rate_hz = 48000.0;
  std::span<const double> gains{};      // (m) Pa at 1 m for unit modal velocity; empty: those of the bank
  double reference_impulse_n_s = 1e-3;  // the strike by which audibility is judged
  double silence_pa = 1e-10;            // -106 dB re 20 uPa: what is not heard
  double sphere_radius_m = 0.0;         // radiation::calc_sphere_radius_m(); 0: of the solid's own volume, without its cavities
  /// A model of the same body, before its bank was edited: where both have the same modes, they stand in its order and share its surface,
  /// which is most of the memory. Which modes are dropped first is then the order of that model.
  const class Model* like = nullptr;
  /// What the modes send into each direction, for Effect::kDirectivity; nullptr: made of the bank's multipoles where it has them.
  std::shared_ptr<const radiation::Transfers> transfers = nullptr;
};

/// What a Model has for Effect::kDirectivity, where the bank has multipoles.
struct ModelDirectivity {
  std::shared_ptr<const radiation::Transfers> transfers;
  std::vector<SoundTable> sound;                  // of modes whose sound is the real part of their state
  std::vector<float> tilt;                        // (ringing modes) t, where 1 + i t times the state is the velocity
  std::vector<float> level;                       // (ringing modes) 1; 0 for modes that are not heard (make_solo)
  std::vector<std::array<float, kGroup>> weight;  // as Model has them, with the loudest direction in place of the gain
  std::vector<float> reach;
  Vec3 offset_m{};  // from the centre of mass to that of the multipoles, axes of the mesh
};

/// Tables for a BendingWatch. Columns are those of a row of shapes.
struct ModelBending {
  static constexpr int kBack = 7, kBackSamples = 4;  // times before the end of a sub-block, and their distance
  double thickness_m = 0.0;                          // find_judged_thickness_m(); 0: deflections are not judged, the rest is empty
  std::vector<float> step_m;            // (columns) displacement of one step of the shape, for the imaginary part 1 of a state, or q = 1
  std::vector<float> largest;           // (columns) largest motion of the mode [steps]
  std::vector<float> back_re, back_im;  // (kBack, ringing columns) rotation of a state back to these times
  std::vector<std::int32_t> vertex;     // places of the sums of deflections
  int watched = 0;                      // sub-blocks after the last one with a force: half a period of the lowest mode and more
};

struct ModelNonlinear;  // nonlinear_modes.hpp

/// Immutable; any number of voices on any threads may share one.
class Model {
 public:
  /// Modes with sqrt(lambda) at or above the Nyquist frequency are left out. Copies what it needs: the bank need not outlive it.
  /// Throws InputError when arrays of the bank or the gains disagree in length, when a triangle names a vertex that does not exist, or when
  /// rate, impulse or silence are not positive numbers. Not for an audio thread.
  static std::shared_ptr<const Model> make(const bank::Bank& bank, const ModelOptions& options = {});

  /// The same body of which one mode alone is heard: all others swing, die away and take their places as they do in `of`, but sound
  /// nothing. `bank_mode` that the model has not: silence. Shares the surface. Not for an audio thread.
  static std::shared_ptr<const Model> make_solo(const Model& of, int bank_mode);

  /// Modes below the Nyquist frequency: first the under-damped ones by audibility (the time until the last is silent after the reference
  /// strike, longest first), then those near and above critical damping. 0 <= mode < get_mode_count() below.
  int get_mode_count() const { return static_cast<int>(modes_.size()); }
  double get_eigenvalue_rad2_s2(int mode) const { return modes_[mode].lambda; }
  double get_decay_per_s(int mode) const { return modes_[mode].decay; }
  /// Of a ringing mode.
  nonlinear::ModeConstants calc_constants(int mode) const { return {modes_[mode].lambda, modes_[mode].decay}; }
  double get_gain(int mode) const { return modes_[mode].gain; }
  /// kg^-1/2 per step of the rows of find_rows().
  double get_scale(int mode) const { return modes_[mode].scale; }
  int get_bank_mode(int mode) const { return modes_[mode].bank_mode; }
  /// How many of them ring: the first ones.
  int get_ringing_mode_count() const { return ringing_; }
  /// phi(x) . direction [kg^-1/2] at a point of a triangle. Throws InputError when the bank has no such triangle.
  double calc_projection(int mode, std::int32_t triangle, const Vec3& barycentric, const Vec3& direction) const;
  double get_rate_hz() const { return rate_hz_; }
  /// Of the rigid body, for acceleration noise: its mass, and the sphere that stands for it. 0 where the bank does not say.
  double get_mass_kg() const { return mass_kg_; }
  double get_sphere_radius_m() const { return sphere_radius_m_; }
  /// E / (1 - nu^2) of the bank's material [Pa].
  double get_plane_strain_modulus_pa() const { return plane_strain_modulus_pa_; }
  double get_wave_impedance_pa_s_m() const { return wave_impedance_pa_s_m_; }
  /// nullptr where the bank has no multipoles, or this build not the effect.
  const ModelDirectivity* get_directivity() const { return directivity_.get(); }
  /// nullptr where the bank has no nonlinear energy of modes that ring, or this build not the effect.
  const ModelNonlinear* get_nonlinear() const { return nonlinear_.get(); }
  /// Whether Effect::kCascade has what it needs: a nonlinear energy with a thickness, a mass, and ringing modes above the coupled ones.
  bool has_cascade() const;
  const ModelBending& get_bending() const { return bending_; }
  /// Centre of mass in the frame of the mesh.
  const Vec3& get_centre_m() const { return centre_m_; }
  /// Memory of the tables, which all voices share, with the transfers, which models of one bank may.
  std::size_t calc_bytes() const;

  /// A mode at, near or above critical damping, as (q, q'). Stiff ones take several substeps a sample while a pulse acts; those whose fast
  /// root dies within a thousandth of a sample take none (0): that root follows the force, and force_q holds the answer of the slow one.
  struct DampedMode {
    double qq, qv, vq, vv;                  // map over one sample
    double sub_qq, sub_qv, sub_vq, sub_vv;  // map over one substep
    Moments force_q, force_v;
    double gain = 0.0, bound = 0.0, scale = 0.0;
    double fast = 0.0, slow = 0.0;  // roots [1/s], of those that follow
    int substeps = 1;
  };
  /// The modes from get_ringing_mode_count() on; ascending in substeps, those that follow a force come first.
  const std::vector<DampedMode>& get_damped_modes() const { return damped_; }
  /// Where the shape of one of them stands in a row of find_rows().
  std::size_t get_damped_column(std::size_t mode) const { return sound_.size() * kGroup + mode; }
  bool has_triangle(std::int32_t triangle) const { return triangle >= 0 && triangle < std::ssize(surface_->triangles); }
  const std::shared_ptr<const ModelSurface>& get_surface() const { return surface_; }

  /// All but the surface as bytes, for another program of the same build: a WebAssembly module makes models in one memory and plays them
  /// in another. No file format. Without what directivity and nonlinear motion need: the model that is read refuses these effects.
  std::vector<std::byte> write_tables() const;
  /// The model of these bytes and its surface. Throws InputError for bytes that are no model's of this build, or do not fit the surface.
  /// Takes no longer than copying the bytes does.
  static std::shared_ptr<const Model> read_tables(std::span<const std::byte> bytes, std::shared_ptr<const ModelSurface> surface);

  /// The shapes of all modes at the corners of a triangle along x, y and z: kStrikeRows rows, three for each corner.
  void find_rows(std::int32_t triangle, const std::int16_t** row) const {
    const auto& corners = surface_->triangles[triangle];
    for (int corner = 0; corner < 3; ++corner) {
      for (int axis = 0; axis < 3; ++axis) row[corner * 3 + axis] = get_row(corners[corner], axis);
    }
  }

 private:
  friend class BendingWatch;
  friend class ContactForces;
  friend class Directivity;
  friend class Voice;

  struct Mode {
    double lambda = 0.0, decay = 0.0, gain = 0.0, scale = 0.0;  // scale: kg^-1/2 per integer step of the shape
    int bank_mode = 0;
  };
  void add_ringing_mode(const Mode& mode);
  void add_damped_modes(const std::vector<Mode>& modes);
  bool has_modes_of(const Model& other) const;
  void copy_shapes(const bank::Bank& bank);
  void find_bounds();
  void find_bending(double thickness_m);
  void add_directivity(std::shared_ptr<const radiation::Transfers> transfers);
  void add_nonlinear(const bank::QuarticEnergy& energy);
  const std::int16_t* get_row(std::int32_t vertex, int axis) const {
    return surface_->shape.data() + (vertex * 3 + static_cast<std::size_t>(axis)) * surface_->columns;
  }

  double rate_hz_ = 0.0;
  double mass_kg_ = 0.0, sphere_radius_m_ = 0.0;
  Vec3 centre_m_{};
  double plane_strain_modulus_pa_ = 0.0, wave_impedance_pa_s_m_ = 0.0;
  std::vector<Mode> modes_;
  int ringing_ = 0;  // modes in groups, the first of modes_; the rest is damped_
  std::vector<SoundTable> sound_;
  std::vector<RotationTable> turn_;
  std::vector<StrikeTable> strike_;
  std::vector<std::array<float, kGroup>> weight_;  // bound on the pressure of a mode is weight times the size of its state
  std::vector<float> reach_;                       // Pa at 1 m per N s: what a strike can make of a group, or of a later one
  ModelBending bending_;
  std::vector<DampedMode> damped_;  // ascending in substeps; those that follow come first
  std::shared_ptr<const ModelSurface> surface_;
  std::shared_ptr<const ModelDirectivity> directivity_;
  std::shared_ptr<const ModelNonlinear> nonlinear_;
};

}  // namespace carillon::synth
