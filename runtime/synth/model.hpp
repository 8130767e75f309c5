// Playback tables of the modes of one bank, sorted by audibility.
//
//   const auto model = synth::Model::make(bank, {.rate_hz = 48000.0});
//   synth::ResonatorBank modes(model);
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/synth/kernels.hpp"
#include "runtime/synth/nonlinear/mode_constants.hpp"
#include "runtime/synth/pulse.hpp"

namespace carillon::radiation {
class Transfers;
}

namespace carillon::synth {

/// Surface of a body for strikes: triangles and mode shapes. Models of one body may share it.
struct ModelSurface {
  std::vector<std::array<std::int32_t, 3>> triangles;
  std::size_t columns = 1;          // of a row of shapes: groups x kGroup ringing modes, then the damped ones; at least one
  std::vector<std::int16_t> shape;  // (V, 3, columns), in steps of each mode's scale
  std::vector<float> largest;       // (groups x kGroup) largest squared motion of each ringing mode, in steps
};

struct ModelOptions {
  double rate_hz = 48000.0;
  std::span<const double> gains{};      // (m) Pa at 1 m for unit modal velocity; empty: those of the bank
  double reference_impulse_n_s = 1e-3;  // reference strike for audibility
  double silence_pa = 1e-10;            // -106 dB re 20 uPa: inaudible
  double sphere_radius_m = 0.0;         // radiation::calc_sphere_radius_m(); 0: from the solid's own volume, without cavities
  /// Model of the same body before an edit of its bank: if both have the same modes, they keep its order and share its surface, which is
  /// most of the memory. The culling order is then that of `like`.
  const class Model* like = nullptr;
  /// For Effect::kDirectivity; nullptr: from the bank's multipoles, if any.
  std::shared_ptr<const radiation::Transfers> transfers = nullptr;
};

/// Tables for Effect::kDirectivity, for banks with multipoles.
struct ModelDirectivity {
  std::shared_ptr<const radiation::Transfers> transfers;
  std::vector<SoundTable> sound;                  // modes whose sound is the real part of their state
  std::vector<float> tilt;                        // (ringing modes) t, where 1 + i t times the state is the velocity
  std::vector<float> level;                       // (ringing modes) 1; 0 for muted modes (make_solo)
  std::vector<std::array<float, kGroup>> weight;  // as in Model, with the loudest direction in place of the gain
  std::vector<float> reach;
  Vec3 offset_m{};  // from the centre of mass to the centre of the multipoles, mesh axes
};

/// Tables for a BendingWatch. Columns are those of a row of shapes.
struct ModelBending {
  static constexpr int kBack = 7, kBackSamples = 4;  // evaluation times before the end of a sub-block, and their distance
  double thickness_m = 0.0;                          // find_judged_thickness_m(); 0: not judged, the rest is empty
  std::vector<float> step_m;            // (columns) displacement of one step of the shape, for the imaginary part 1 of a state, or q = 1
  std::vector<float> largest;           // (columns) largest motion of the mode [steps]
  std::vector<float> back_re, back_im;  // (kBack, ringing columns) rotation of a state back to these times
  std::vector<std::int32_t> vertex;     // vertices at which deflections are summed
  int watched = 0;                      // sub-blocks after the last one with a force: half a period of the lowest mode and more
};

struct ModelNonlinear;  // nonlinear_modes.hpp

/// Immutable; shared by any number of ResonatorBanks on any threads.
class Model {
 public:
  /// Leaves out modes with sqrt(lambda) at or above the Nyquist frequency. Copies its data: the bank need not outlive it. Throws InputError
  /// if arrays of the bank or the gains disagree in length, a triangle names a missing vertex, or rate, impulse or silence are not
  /// positive. Not for an audio thread.
  static std::shared_ptr<const Model> make(const bank::Bank& bank, const ModelOptions& options = {});

  /// The same body with one audible mode: all others move as in `of`, but are muted. Missing `bank_mode`: silence. Shares the surface. Not
  /// for an audio thread.
  static std::shared_ptr<const Model> make_solo(const Model& of, int bank_mode);

  /// Modes below the Nyquist frequency: first the under-damped ones by audibility (time until inaudible after the reference strike, longest
  /// first), then those near and above critical damping. 0 <= mode < get_mode_count() below.
  int get_mode_count() const { return static_cast<int>(modes_.size()); }
  double get_eigenvalue_rad2_s2(int mode) const { return modes_[mode].lambda; }
  double get_decay_per_s(int mode) const { return modes_[mode].decay; }
  /// Constants of a ringing mode.
  nonlinear::ModeConstants calc_constants(int mode) const { return {modes_[mode].lambda, modes_[mode].decay}; }
  double get_gain(int mode) const { return modes_[mode].gain; }
  /// kg^-1/2 per step of the rows of find_rows().
  double get_scale(int mode) const { return modes_[mode].scale; }
  int get_bank_mode(int mode) const { return modes_[mode].bank_mode; }
  /// Number of ringing modes, the first ones.
  int get_ringing_mode_count() const { return ringing_; }
  /// phi(x) . direction [kg^-1/2] at a point of a triangle. Throws InputError for a missing triangle.
  double calc_projection(int mode, std::int32_t triangle, const Vec3& barycentric, const Vec3& direction) const;
  double get_rate_hz() const { return rate_hz_; }
  /// Rigid body for acceleration noise: mass, and radius of the equivalent sphere. 0 if missing in the bank.
  double get_mass_kg() const { return mass_kg_; }
  double get_sphere_radius_m() const { return sphere_radius_m_; }
  /// E / (1 - nu^2) of the bank's material [Pa].
  double get_plane_strain_modulus_pa() const { return plane_strain_modulus_pa_; }
  double get_wave_impedance_pa_s_m() const { return wave_impedance_pa_s_m_; }
  /// nullptr for banks without multipoles.
  const ModelDirectivity* get_directivity() const { return directivity_.get(); }
  /// nullptr for banks without a nonlinear energy of ringing modes.
  const ModelNonlinear* get_nonlinear() const { return nonlinear_.get(); }
  /// True if Effect::kCascade is possible: a nonlinear energy with a thickness, a mass, and ringing modes above the coupled ones.
  bool has_cascade() const;
  const ModelBending& get_bending() const { return bending_; }
  /// Centre of mass in the frame of the mesh.
  const Vec3& get_centre_m() const { return centre_m_; }
  /// Memory of the shared tables [bytes], with the transfers, which models of one bank may share.
  std::size_t calc_bytes() const;

  /// A mode at, near or above critical damping, as (q, q'). Stiff ones take several substeps per sample during pulses; those whose fast
  /// root decays within a thousandth of a sample take none (0): that root follows the force, and force_q is the response of the slow one.
  struct DampedMode {
    double qq, qv, vq, vv;                  // map over one sample
    double sub_qq, sub_qv, sub_vq, sub_vv;  // map over one substep
    Moments force_q, force_v;
    double gain = 0.0, bound = 0.0, scale = 0.0;
    double fast = 0.0, slow = 0.0;  // roots [1/s], if substeps is 0
    int substeps = 1;
  };
  /// Modes from get_ringing_mode_count() on; ascending in substeps, those that follow the force first.
  const std::vector<DampedMode>& get_damped_modes() const { return damped_; }
  /// Column of its shape in a row of find_rows().
  std::size_t get_damped_column(std::size_t mode) const { return sound_.size() * kGroup + mode; }
  bool has_triangle(std::int32_t triangle) const { return triangle >= 0 && triangle < std::ssize(surface_->triangles); }
  const std::shared_ptr<const ModelSurface>& get_surface() const { return surface_; }

  /// All data except the surface as bytes, for another program of the same build: a WebAssembly module makes models in one memory and plays
  /// them in another. Not a file format. Without directivity and nonlinear data: the model read back refuses these effects.
  std::vector<std::byte> write_tables() const;
  /// Model from such bytes and its surface. Throws InputError for bytes of another build or that do not fit the surface. Costs a copy.
  static std::shared_ptr<const Model> read_tables(std::span<const std::byte> bytes, std::shared_ptr<const ModelSurface> surface);

  /// Shapes of all modes at the corners of a triangle along x, y and z: kStrikeRows rows, three per corner.
  void find_rows(std::int32_t triangle, const std::int16_t** row) const {
    const auto& corners = surface_->triangles[triangle];
    for (int corner = 0; corner < 3; ++corner) {
      for (int axis = 0; axis < 3; ++axis) row[corner * 3 + axis] = get_row(corners[corner], axis);
    }
  }

  /// Shape row of a vertex along an axis, all modes.
  const std::int16_t* get_row(std::int32_t vertex, int axis) const {
    return surface_->shape.data() + (vertex * 3 + static_cast<std::size_t>(axis)) * surface_->columns;
  }

  /// Tables of the ringing modes, by group.
  const std::vector<SoundTable>& get_sound_tables() const { return sound_; }
  const std::vector<RotationTable>& get_rotation_tables() const { return turn_; }
  const std::vector<StrikeTable>& get_strike_tables() const { return strike_; }
  /// Bound on the pressure of a mode per size of its state.
  const std::vector<std::array<float, kGroup>>& get_weights() const { return weight_; }
  /// Bound on the pressure at 1 m [Pa per N s] of a group, or a later one, after a strike.
  const std::vector<float>& get_reach() const { return reach_; }

 private:
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

  double rate_hz_ = 0.0;
  double mass_kg_ = 0.0, sphere_radius_m_ = 0.0;
  Vec3 centre_m_{};
  double plane_strain_modulus_pa_ = 0.0, wave_impedance_pa_s_m_ = 0.0;
  std::vector<Mode> modes_;
  int ringing_ = 0;  // modes in groups, the first of modes_; the rest is damped_
  std::vector<SoundTable> sound_;
  std::vector<RotationTable> turn_;
  std::vector<StrikeTable> strike_;
  std::vector<std::array<float, kGroup>> weight_;  // get_weights()
  std::vector<float> reach_;                       // get_reach()
  ModelBending bending_;
  std::vector<DampedMode> damped_;  // ascending in substeps; those that follow the force first
  std::shared_ptr<const ModelSurface> surface_;
  std::shared_ptr<const ModelDirectivity> directivity_;
  std::shared_ptr<const ModelNonlinear> nonlinear_;
};

}  // namespace carillon::synth
