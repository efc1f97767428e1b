#pragma once

/// KNAV_MULTIVERSION compiles a function for plain x86-64 and for AVX2 machines; the program chooses at run time.
/// Both give the same bytes: the build switches off fused multiply-add (-ffp-contract=off), and such functions must
/// not reorder floating point sums. Sanitizers cannot run code in a resolver, hence no versions there.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__) && defined(__OPTIMIZE__)
#define KNAV_MULTIVERSION __attribute__((target_clones("default", "avx2")))
#else
#define KNAV_MULTIVERSION
#endif

/// Where the compiler finds no vector code, functions written with intrinsics are marked KNAV_AVX2 and called only if
/// cpu_has_avx2().
#ifdef __x86_64__
#define KNAV_HAVE_AVX2_CODE 1
#define KNAV_AVX2 __attribute__((target("avx2")))
#endif

namespace knav {
inline bool cpu_has_avx2() {
#ifdef KNAV_HAVE_AVX2_CODE
  static const bool has = __builtin_cpu_supports("avx2") != 0;
  return has;
#else
  return false;
#endif
}
}  // namespace knav
