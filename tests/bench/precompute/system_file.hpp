// K, M and the answers as files, read and written by every rival of the bench and by rivals.py; native byte order.
//   matrix: int64 n, int64 nnz, int32 first[n + 1], int32 column[nnz], float64 value[nnz]   (CSR, both triangles; equally CSC)
//   answer: int64 n, int64 k, float64 lambda[k], float64 vector[k][n]
#pragma once

#include <sys/resource.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

namespace bench {

struct Matrix {
  std::int64_t n = 0;
  std::int64_t nnz = 0;
  std::vector<std::int32_t> first;   // (n + 1)
  std::vector<std::int32_t> column;  // (nnz), ascending in each row
  std::vector<double> value;         // (nnz)
};

inline void demand(bool ok, const std::string& what) {
  if (!ok) throw std::runtime_error(what);
}

inline Matrix read_matrix(const std::string& file) {
  std::FILE* stream = std::fopen(file.c_str(), "rb");
  demand(stream != nullptr, file + ": cannot be opened");
  Matrix matrix;
  std::int64_t head[2] = {0, 0};
  bool ok = std::fread(head, sizeof head, 1, stream) == 1;
  matrix.n = head[0];
  matrix.nnz = head[1];
  matrix.first.resize(matrix.n + 1);
  matrix.column.resize(matrix.nnz);
  matrix.value.resize(matrix.nnz);
  ok = ok && std::fread(matrix.first.data(), sizeof(std::int32_t), matrix.first.size(), stream) == matrix.first.size();
  ok = ok && std::fread(matrix.column.data(), sizeof(std::int32_t), matrix.column.size(), stream) == matrix.column.size();
  ok = ok && std::fread(matrix.value.data(), sizeof(double), matrix.value.size(), stream) == matrix.value.size();
  std::fclose(stream);
  demand(ok, file + ": ends too early");
  return matrix;
}

/// lambda: (k); vectors: (n, k) column-major.
inline void write_answer(const std::string& file, std::int64_t n, const std::vector<double>& lambda, const double* vectors) {
  std::FILE* stream = std::fopen(file.c_str(), "wb");
  demand(stream != nullptr, file + ": cannot be written");
  const std::int64_t head[2] = {n, static_cast<std::int64_t>(lambda.size())};
  bool ok = std::fwrite(head, sizeof head, 1, stream) == 1;
  ok = ok && std::fwrite(lambda.data(), sizeof(double), lambda.size(), stream) == lambda.size();
  ok = ok && std::fwrite(vectors, sizeof(double), n * lambda.size(), stream) == n * lambda.size();
  ok = std::fclose(stream) == 0 && ok;
  demand(ok, file + ": disk full?");
}

/// y = A x, one vector.
inline void multiply(const Matrix& a, const double* x, double* y) {
  for (std::int64_t row = 0; row < a.n; ++row) {
    double sum = 0;
    for (std::int32_t at = a.first[row]; at < a.first[row + 1]; ++at) sum += a.value[at] * x[a.column[at]];
    y[row] = sum;
  }
}

/// Command line shared by all rivals.
struct Arguments {
  std::string stiffness, mass, answer, phases;
  int modes = 0;     // number of lowest eigenvalues wanted, rigid ones included
  double sigma = 0;  // shift, below all eigenvalues
  double tolerance = 1e-8;
};

inline Arguments parse_arguments(int argc, char** argv) {
  demand(argc >= 8, std::string("usage: ") + argv[0] + " K.csr M.csr MODES SIGMA TOLERANCE ANSWER PHASES.json");
  return {argv[1], argv[2], argv[6], argv[7], std::atoi(argv[3]), std::atof(argv[4]), std::atof(argv[5])};
}

/// CPU seconds of this process (user + system) by phase, written as JSON at the end.
class Phases {
 public:
  /// Assigns the time since the last call, or since the start of the process, to `name`.
  void end(const std::string& name) {
    const double now = get_cpu_seconds();
    seconds_[name] += now - last_;
    last_ = now;
  }
  void count(const std::string& name, double value) { counts_[name] = value; }
  void write(const std::string& file) {
    count("peak_bytes", find_peak_bytes());
    std::FILE* stream = std::fopen(file.c_str(), "w");
    demand(stream != nullptr, file + ": cannot be written");
    std::fprintf(stream, "{\"cpu_seconds\": {");
    const char* comma = "";
    for (const auto& [name, value] : seconds_) {
      std::fprintf(stream, "%s\"%s\": %.6f", comma, name.c_str(), value);
      comma = ", ";
    }
    std::fprintf(stream, "}");
    for (const auto& [name, value] : counts_) std::fprintf(stream, ", \"%s\": %.17g", name.c_str(), value);
    std::fprintf(stream, "}\n");
    std::fclose(stream);
  }

 private:
  static double get_cpu_seconds() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return static_cast<double>(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
           1e-6 * static_cast<double>(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
  }

  /// Of this program only; wait4() reports at least the size of the parent process.
  static double find_peak_bytes() {
    double kilobytes = 0;
    std::FILE* stream = std::fopen("/proc/self/status", "r");
    demand(stream != nullptr, "/proc/self/status: cannot be opened");
    for (char line[256]; std::fgets(line, sizeof line, stream) != nullptr;)
      if (std::sscanf(line, "VmHWM: %lf", &kilobytes) == 1) break;
    std::fclose(stream);
    return 1024 * kilobytes;
  }

  double last_ = 0;
  std::map<std::string, double> seconds_;
  std::map<std::string, double> counts_;
};

}  // namespace bench
