// tracker_knobs [--early] [--unknown] [--max-impacts N] ARGUMENTS: engine_bullet with knobs of the contact tracker. --unknown: the tracker
// is given no impulses. Prints what engine_bullet does, and the tracker's CPU time as JSON.
#include <carillon.h>

#include <cstdio>
#include <cstdlib>
#include <limits>
#include <string_view>
#include <vector>

#include "runtime/base/clock.hpp"

int drive_main(int argc, char** argv);  // of tests/system/engines/drive.cpp

namespace {

bool is_early = false, is_unknown = false;
int max_impacts = -1;
double tracker_s = 0.0;

}  // namespace

// The linker puts these between the engine and the tracker (--wrap).
extern "C" {
carillon_status __real_carillon_touches_create(carillon_synth*, const carillon_touches_options*, carillon_touches**, char*, size_t);
carillon_status __real_carillon_touches_step(carillon_touches*, double, const carillon_pose*, int32_t, const carillon_point*, int32_t,
                                             char*, size_t);

carillon_status __wrap_carillon_touches_create(carillon_synth* synth, const carillon_touches_options* options, carillon_touches** touches,
                                               char* message, size_t size) {
  carillon_touches_options chosen = *options;
  if (is_early) chosen.early = 1;
  if (max_impacts >= 0) chosen.max_impacts = max_impacts;
  return __real_carillon_touches_create(synth, &chosen, touches, message, size);
}

carillon_status __wrap_carillon_touches_step(carillon_touches* touches, double time_s, const carillon_pose* poses, int32_t bodies,
                                             const carillon_point* points, int32_t count, char* message, size_t size) {
  std::vector<carillon_point> given(points, points + count);
  if (is_unknown)
    for (carillon_point& point : given) {
      point.impulse_n_s = std::numeric_limits<double>::quiet_NaN();
      for (double& x : point.friction_n_s) x = std::numeric_limits<double>::quiet_NaN();
    }
  const double began_s = carillon::base::get_thread_cpu_s();
  const carillon_status status = __real_carillon_touches_step(touches, time_s, poses, bodies, given.data(), count, message, size);
  tracker_s += carillon::base::get_thread_cpu_s() - began_s;
  return status;
}
}

int main(int argc, char** argv) {
  std::vector<char*> left{argv[0]};
  for (int n = 1; n < argc; ++n) {
    const std::string_view word = argv[n];
    if (word == "--early")
      is_early = true;
    else if (word == "--unknown")
      is_unknown = true;
    else if (word == "--max-impacts" && n + 1 < argc)
      max_impacts = std::atoi(argv[++n]);
    else
      left.push_back(argv[n]);
  }
  left.push_back(nullptr);
  const int code = drive_main(static_cast<int>(left.size()) - 1, left.data());
  if (code == 0) std::printf("{\"tracker_cpu_s\": %.6g}\n", tracker_s);
  return code;
}
