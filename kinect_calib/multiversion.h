#pragma once

// KNAV_MULTIVERSION before a function compiles it for plain x86-64, AVX2 and AVX-512 and picks one when the
// library is loaded. Contraction to fused multiply-add is off in the whole project, so all give the same
// bytes. Sanitizers cannot run code in a resolver, hence no versions there.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__) && defined(__OPTIMIZE__)
#define KNAV_MULTIVERSION __attribute__((target_clones("default", "avx2", "avx512f")))
#else
#define KNAV_MULTIVERSION
#endif
