# Every record of config/measurements.tsv on one page: `snakemake -j2 campaign` makes results/campaign.html. A record is
# two jobs (comparison, diagnosis), whose memory is that of one record; the page reads their numbers, not the records.
# Records of one rig share an entry; structures, whose coefficients have places, are left out.
CAMPAIGN = {name: row.entry for name, row in MEASUREMENTS.items() if name not in OF_STRUCTURES}


rule campaign:
    input:
        comparisons=[f"results/{name}/comparison.json" for name in CAMPAIGN],
        diagnoses=[f"results/{name}/diagnosis.json" for name in CAMPAIGN],
        code=modules("campaign"),
    output:
        page="results/campaign.html",
    params:
        rigs=CAMPAIGN,
    script:
        "../scripts/campaign.py"
