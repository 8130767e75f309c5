// libspatialaudio, to which Ambisonics of carillon-render are compared.
//   ambisonics ORDER AZIMUTH ELEVATION    prints the gain of each channel for a source there [rad]
//   ambisonics cube FILE.f32              decodes order 1, interleaved frames of four floats, to a cube of loudspeakers: the energy of each
#include <spatialaudio/Ambisonics.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>

int main(int argc, char** argv) {
  if (argc == 4) {
    CAmbisonicEncoder encoder;
    encoder.Configure(std::atoi(argv[1]), true, 0);
    PolarPoint place{};
    place.fAzimuth = static_cast<float>(std::atof(argv[2]));
    place.fElevation = static_cast<float>(std::atof(argv[3]));
    place.fDistance = 1.0F;
    encoder.SetPosition(place);
    encoder.Refresh();
    for (unsigned c = 0; c < encoder.GetChannelCount(); ++c) std::printf("%.9g\n", encoder.GetCoefficient(c));
    return 0;
  }
  if (argc != 3 || std::strcmp(argv[1], "cube") != 0) return 2;
  std::vector<float> frames;
  std::FILE* file = std::fopen(argv[2], "rb");
  for (float value = 0.0F; file != nullptr && std::fread(&value, sizeof value, 1, file) == 1;) frames.push_back(value);
  const auto count = static_cast<unsigned>(frames.size() / 4);
  CBFormat sound;
  sound.Configure(1, true, count);
  for (unsigned c = 0; c < 4; ++c) {
    std::vector<float> channel(count);
    for (unsigned n = 0; n < count; ++n) channel[n] = frames[4 * n + c];
    sound.InsertStream(channel.data(), c, count);
  }
  CAmbisonicDecoder decoder;
  decoder.Configure(1, true, kAmblib_CustomSpeakerSetUp, 8);  // kAmblib_Cube is none: its corners are 45 degrees up
  for (unsigned s = 0; s < 8; ++s) {
    PolarPoint corner{};
    corner.fAzimuth = static_cast<float>(M_PI / 4 + M_PI / 2 * (s % 4));
    corner.fElevation = static_cast<float>((s < 4 ? 1 : -1) * std::atan(std::sqrt(0.5)));
    corner.fDistance = 1.0F;
    decoder.SetPosition(s, corner);
  }
  decoder.Refresh();
  std::vector<std::vector<float>> out(decoder.GetSpeakerCount(), std::vector<float>(count));
  std::vector<float*> rows;
  for (auto& row : out) rows.push_back(row.data());
  decoder.Process(&sound, count, rows.data());
  for (unsigned s = 0; s < out.size(); ++s) {
    double energy = 0.0;
    for (const float p : out[s]) energy += static_cast<double>(p) * p;
    const PolarPoint place = decoder.GetPosition(s);
    std::printf("%.9g %.9g %.9g\n", energy, place.fAzimuth, place.fElevation);
  }
  return 0;
}
