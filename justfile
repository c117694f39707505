# The steps of .ci/run one by one, and what else is at hand.

default:
    @just --list

# Everything CI does
ci:
    .ci/run

fmt:
    cargo fmt --all

lint:
    cargo fmt --all --check
    cargo clippy --workspace --all-targets -- -D warnings

test:
    cargo test --workspace

doc:
    RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps

bench:
    cargo run --release -- bench

# The page of the viewer, built from its sources; needs npm
viewer:
    npm ci --prefix viewer/page --ignore-scripts
    npm run --prefix viewer/page build

# Licences, sources and spelling; need cargo-deny and typos
hygiene:
    cargo deny check bans licenses sources
    typos
