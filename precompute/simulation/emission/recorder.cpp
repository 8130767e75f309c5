// Method: whole blocks of samples, and keys, are gathered from all ranks and written by rank 0. docs/surface-format.md.
#include "precompute/simulation/emission/recorder.hpp"

#include <algorithm>
#include <cmath>
#include <span>

namespace carillon::emission {

Recorder::Recorder(const Surfaces& surfaces, const Options& options) : surfaces_(surfaces) {
  const double fs = options.sample_rate_hz;
  header_.sample_rate_hz = fs;
  header_.air_density_kg_m3 = options.air_density_kg_m3;
  header_.sound_speed_m_s = options.sound_speed_m_s;
  header_.frames = options.frames;
  header_.key_frames = std::max<std::uint64_t>(1, static_cast<std::uint64_t>(std::llround(fs / options.keep_hz)));
  header_.vertices = surfaces.vertex_total;
  header_.triangles = surfaces.triangle_total;
  header_.bodies = surfaces.tables.radius_m.size();
  surfaces.comm.agree([&] {
    const auto own = std::count_if(surfaces.place.begin(), surfaces.place.end(), [](std::int64_t one) { return one >= 0; });
    block_.assign(static_cast<std::size_t>(own) * recording::kBlockFrames, 0.0F);
    if (surfaces.comm.is_root()) file_ = std::make_unique<SurfaceFile>(options.surface_file, header_, surfaces.tables, options.is_resumed);
  });
}

bool Recorder::record(std::int64_t k, const double* x, Sources& sources) {
  const auto frame = static_cast<std::uint64_t>(k);
  bool is_fine = true;
  if (frame < header_.frames) {
    const std::size_t at = frame % recording::kBlockFrames;
    std::size_t own = 0;
    for (std::size_t begin = 0; begin < surfaces_.get_slots(); begin += kLane) {
      const double* source = sources.get(begin, k).data;
      for (std::size_t t = begin; t < begin + kLane; ++t)
        if (surfaces_.place[t] >= 0)
          block_[own++ * recording::kBlockFrames + at] = static_cast<float>(source[t - begin] / surfaces_.area[t]);
    }
    if (at + 1 == recording::kBlockFrames || frame + 1 == header_.frames) write_block(frame / recording::kBlockFrames, is_fine);
  }
  if (frame % header_.key_frames == 0 && frame / header_.key_frames < header_.count_keys())
    write_key(frame / header_.key_frames, x, is_fine);
  return is_fine;
}

void Recorder::write_block(std::uint64_t number, bool& is_fine) {
  const std::size_t own = block_.size() / recording::kBlockFrames;
  std::vector<float> scale(own, 0.0F);
  std::vector<std::int16_t> value(block_.size());
  for (std::size_t t = 0; t < own; ++t) {
    const auto row = std::span(block_).subspan(t * recording::kBlockFrames, recording::kBlockFrames);
    float most = 0.0F;
    for (float& one : row) {
      if (!(std::abs(one) <= 1e12F)) {
        is_fine = false;
        one = 0.0F;
      }
      most = std::max(most, std::abs(one));
    }
    scale[t] = most / 32767.0F;
    for (std::size_t i = 0; i < row.size(); ++i)
      value[t * recording::kBlockFrames + i] =
          scale[t] > 0.0F ? static_cast<std::int16_t>(std::clamp(std::lrint(row[i] / scale[t]), -32767L, 32767L)) : std::int16_t{0};
  }
  std::fill(block_.begin(), block_.end(), 0.0F);
  const auto scales = surfaces_.comm.all_gather(scale);
  const auto values = surfaces_.comm.all_gather(value);
  surfaces_.comm.agree([&] {
    if (!surfaces_.comm.is_root()) return;
    std::vector<float> all_scales(surfaces_.triangle_total);
    std::vector<std::int16_t> all_values(surfaces_.triangle_total * recording::kBlockFrames);
    for (std::size_t i = 0; i < scales.size(); ++i) {
      const std::size_t at = surfaces_.gathered_places[i];
      all_scales[at] = scales[i];
      std::copy_n(values.begin() + static_cast<std::ptrdiff_t>(i * recording::kBlockFrames), recording::kBlockFrames,
                  all_values.begin() + static_cast<std::ptrdiff_t>(at * recording::kBlockFrames));
    }
    file_->write_block(number, all_scales, all_values);
  });
}

void Recorder::write_key(std::uint64_t key, const double* x, bool& is_fine) {
  std::vector<Vec3> vertices = surfaces_.gather_vertices(x);
  for (Vec3& vertex : vertices)
    for (double& one : vertex)
      if (!(std::abs(one) <= 1e6)) {
        is_fine = false;
        one = 0.0;
      }
  surfaces_.comm.agree([&] {
    if (file_) file_->write_key(key, vertices);
  });
  keys_written_ = static_cast<std::int64_t>(key) + 1;
}

}  // namespace carillon::emission
